//! Charts of the critics: losses, values, and the surgery on their gradients.

use firmware_sim::page::axis::Scale;
use firmware_sim::page::chart::{Chart, Layer};

use super::{chart, lines};
use crate::data::ToGo;
use crate::report::folder::RunFolder;

pub(super) fn losses(run: &RunFolder) -> Chart<'_> {
    let columns = [
        ("critic_loss_reward", "reward"),
        ("critic_loss_long_cost", "long-term cost"),
        ("critic_loss_short_cost", "short-term cost"),
    ];
    Chart {
        layers: lines(run, &columns),
        caption: "Squared error of the twins' values (Eq. 4). Losses grow with the values they fit.".to_owned(),
        ..chart(run, "Critic losses", "scaled reward or cost, squared", Scale::Log)
    }
}

pub(super) fn state_value_losses(run: &RunFolder) -> Chart<'_> {
    let columns = [
        ("value_loss_reward", "reward"),
        ("value_loss_long_cost", "long-term cost"),
        ("value_loss_short_cost", "short-term cost"),
    ];
    Chart {
        layers: lines(run, &columns),
        caption: "Expectile loss of the state values, where targets bootstrap from them.".to_owned(),
        ..chart(run, "State-value losses", "scaled reward or cost, squared", Scale::Log)
    }
}

fn values<'a>(run: &'a RunFolder, columns: [&str; 3], to_go: &ToGo) -> Vec<Layer<'a>> {
    let [low, mean, high] = columns.map(|column| run.metrics.get(column));
    vec![
        Layer::Band { label: "data (inner: 5 to 95 %)".to_owned(), low: to_go.min, high: to_go.max },
        Layer::Band { label: String::new(), low: to_go.p5, high: to_go.p95 },
        Layer::Area { label: "policy, smallest to largest".to_owned(), colour: 0, low, high },
        Layer::Line { label: "policy, mean".to_owned(), colour: 0, values: mean },
    ]
}

pub(super) fn rewards(run: &RunFolder) -> Chart<'_> {
    Chart {
        layers: values(run, ["q_reward_min", "q_reward", "q_reward_max"], &run.provenance.reward_to_go),
        caption: "Q_r at the policy's actions against the data's discounted rewards to go. Values far outside the grey have no support.".to_owned(),
        ..chart(run, "Reward values", "scaled reward", Scale::Linear)
    }
}

pub(super) fn costs(run: &RunFolder) -> Chart<'_> {
    let columns = ["q_long_cost_min", "q_long_cost", "q_long_cost_max"];
    Chart {
        layers: values(run, columns, &run.provenance.cost_to_go),
        caption: "Q_cL at the policy's actions against the data's discounted costs to go.".to_owned(),
        ..chart(run, "Long-term cost values", "scaled cost", Scale::Linear)
    }
}

pub(super) fn conflicts(run: &RunFolder) -> Chart<'_> {
    let columns = [
        ("conflicts_0", "no pair"),
        ("conflicts_1", "one pair"),
        ("conflicts_2", "two pairs"),
        ("conflicts_3", "three pairs"),
    ];
    Chart {
        ends: Some([0.0, 1.0]),
        layers: lines(run, &columns),
        caption: "Steps by pairs of trunk gradients in conflict. The paper has .50, .12, .38 and .0003 (Table A1)."
            .to_owned(),
        ..chart(run, "Conflicts", "share of steps", Scale::Linear)
    }
}

pub(super) fn trunk_norms(run: &RunFolder) -> Chart<'_> {
    let columns = [
        ("gradient_trunk_reward", "reward"),
        ("gradient_trunk_long_cost", "long-term cost"),
        ("gradient_trunk_short_cost", "short-term cost"),
    ];
    Chart {
        layers: lines(run, &columns),
        caption: "Each task's gradient of the shared trunk before surgery (Eq. 5). A task that towers over the others rules the trunk.".to_owned(),
        ..chart(run, "Trunk gradients", "norm", Scale::Log)
    }
}
