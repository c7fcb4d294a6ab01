//! Which charts a report holds.

use firmware_sim::page::axis::{Scale, label};
use firmware_sim::page::chart::{Chart, Layer};

use super::folder::RunFolder;
use crate::critic::bootstrap::Bootstrap;
use crate::data::{Sorted, ToGo};
use crate::extraction::Extraction;

/// Charts under one heading.
pub(super) struct Section<'a> {
    pub(super) title: &'static str,
    pub(super) charts: Vec<Chart<'a>>,
}

/// All charts of a run, but those of what it does not have.
pub(super) fn sections(run: &RunFolder) -> Vec<Section<'_>> {
    let in_sample = run.config.bootstrap == Bootstrap::InSample;
    let weighted = run.config.extraction == Extraction::Weighted;
    let state_values = in_sample.then(|| value_losses(run));
    let advantages = weighted.then(|| [batch_weights(run), advantage_scales(run)]);
    let dual = (!weighted).then(|| [lambda(run), penalty(run)]);
    let critic = [critic_losses(run)].into_iter().chain(state_values).chain([reward_values(run), cost_values(run)]);
    let actor = [cloning(run)].into_iter().chain(dual.into_iter().flatten()).chain([norms(run)]);
    let reweighting = [weights(run), active(run)].into_iter().chain(advantages.into_iter().flatten());
    vec![
        Section { title: "Critic", charts: critic.collect() },
        Section { title: "Gradient surgery", charts: vec![conflicts(run), trunk_norms(run)] },
        Section { title: if weighted { "Actor" } else { "Actor and dual" }, charts: actor.collect() },
        Section { title: "Reweighting", charts: reweighting.collect() },
        Section { title: "Speed", charts: vec![speed(run)] },
    ]
}

/// A chart over the rows of `metrics.csv`.
fn chart<'a>(run: &'a RunFolder, title: &'static str, unit: &'static str, scale: Scale) -> Chart<'a> {
    let steps = run.metrics.get("step");
    Chart {
        title,
        across: "training steps",
        unit,
        scale,
        ends: None,
        steps,
        layers: Vec::new(),
        caption: String::new(),
    }
}

/// Curves of `metrics.csv`, each with its own colour.
fn lines<'a>(run: &'a RunFolder, columns: &[(&str, &str)]) -> Vec<Layer<'a>> {
    let line = |(colour, (column, label)): (usize, &(&str, &str))| Layer::Line {
        label: (*label).to_owned(),
        colour,
        values: run.metrics.get(column),
    };
    columns.iter().enumerate().map(line).collect()
}

fn critic_losses(run: &RunFolder) -> Chart<'_> {
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

fn value_losses(run: &RunFolder) -> Chart<'_> {
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

fn reward_values(run: &RunFolder) -> Chart<'_> {
    Chart {
        layers: values(run, ["q_reward_min", "q_reward", "q_reward_max"], &run.provenance.reward_to_go),
        caption: "Q_r at the policy's actions against the data's discounted rewards to go. Values far outside the grey have no support.".to_owned(),
        ..chart(run, "Reward values", "scaled reward", Scale::Linear)
    }
}

fn cost_values(run: &RunFolder) -> Chart<'_> {
    let columns = ["q_long_cost_min", "q_long_cost", "q_long_cost_max"];
    Chart {
        layers: values(run, columns, &run.provenance.cost_to_go),
        caption: "Q_cL at the policy's actions against the data's discounted costs to go.".to_owned(),
        ..chart(run, "Long-term cost values", "scaled cost", Scale::Linear)
    }
}

fn conflicts(run: &RunFolder) -> Chart<'_> {
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

fn trunk_norms(run: &RunFolder) -> Chart<'_> {
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

fn cloning(run: &RunFolder) -> Chart<'_> {
    let entries = run.provenance.action_entries as f64;
    let mut layers = vec![Layer::Level { label: format!("no prediction ({entries})"), at: entries }];
    layers.extend(lines(run, &[("cloning_loss", "behaviour cloning")]));
    Chart {
        layers,
        caption: "Weighted error of the predicted noise (Eq. 13). It jumps where the weights are refreshed.".to_owned(),
        ..chart(run, "Cloning loss", "noise variance, all action entries", Scale::Log)
    }
}

fn lambda(run: &RunFolder) -> Chart<'_> {
    let cap = run.config.log_lambda_max.exp();
    let [none, half, limit, max] = [0.0, run.config.limit / 2.0, run.config.limit, run.provenance.max_kappa]
        .map(|kappa| format!("kappa {}", label(kappa)));
    let columns = [
        ("lambda_kappa_0", none.as_str()),
        ("lambda_kappa_half", &half),
        ("lambda_kappa_limit", &limit),
        ("lambda_kappa_max", &max),
        ("lambda", "mean of the batch"),
    ];
    let mut layers = vec![Layer::Level { label: format!("cap {}", label(cap)), at: cap }];
    layers.extend(lines(run, &columns));
    Chart {
        layers,
        caption: format!(
            "The price of cost by remaining budget: none, half the limit, the limit {}, and the data's largest. Where it is near 0 the constraint is inactive.",
            label(run.config.limit)
        ),
        ..chart(run, "Lambda by budget", "scaled reward per scaled cost", Scale::Log)
    }
}

fn penalty(run: &RunFolder) -> Chart<'_> {
    // The first rows, before lambda has settled, would flatten all that follows.
    let sorted = Sorted::new(run.metrics.get("penalty").iter().copied());
    let [low, high] = [0.02, 0.98].map(|q| sorted.quantile(q));
    let margin = 0.1 * (high - low);
    Chart {
        ends: Some([low - margin, high + margin]),
        layers: lines(run, &[("penalty", "mean")]),
        caption: "lambda (Q_cL - kappa) in the actor's loss (Eq. 15). Below 0 the policy has budget to spare. The axis holds the middle 96 % of the rows."
            .to_owned(),
        ..chart(run, "Penalty", "scaled reward", Scale::Linear)
    }
}

fn norms(run: &RunFolder) -> Chart<'_> {
    let columns = [("gradient_critic", "critic"), ("gradient_actor", "actor"), ("gradient_dual", "dual")];
    Chart {
        layers: lines(run, &columns),
        caption: "What the optimisers saw.".to_owned(),
        ..chart(run, "Gradients", "norm", Scale::Log)
    }
}

fn weights(run: &RunFolder) -> Chart<'_> {
    let get = |column| run.metrics.get(column);
    let area = |label: &str, colour, low, high| Layer::Area {
        label: label.to_owned(),
        colour,
        low: get(low),
        high: get(high),
    };
    let mut layers = vec![
        area("smallest to largest (inner: 10 to 90 %)", 0, "weight_min", "weight_max"),
        area("", 0, "weight_p10", "weight_p90"),
    ];
    layers.extend(lines(run, &[("weight_p50", "median"), ("weight_p95", "95 %"), ("weight_p99", "99 %")]));
    Chart {
        layers,
        caption: "Weights w of Eq. 10 over all transitions; 1 before the first refresh.".to_owned(),
        ..chart(run, "Weights", "weight", Scale::Linear)
    }
}

fn active(run: &RunFolder) -> Chart<'_> {
    Chart {
        layers: lines(run, &[("counterfactual_active", "active")]),
        caption: "Transitions with a counterfactual weight above 1 (Eq. 9).".to_owned(),
        ..chart(run, "Active counterfactual weights", "share of transitions", Scale::Linear)
    }
}

fn batch_weights(run: &RunFolder) -> Chart<'_> {
    let columns = [("advantage_weight_mean", "mean weight"), ("advantage_weight_effective", "effective share")];
    Chart {
        layers: lines(run, &columns),
        caption: "Advantage weights of a batch: their mean before it is divided out, and the share of the batch that they leave effective."
            .to_owned(),
        ..chart(run, "Advantage weights", "weight, share of the batch", Scale::Log)
    }
}

fn advantage_scales(run: &RunFolder) -> Chart<'_> {
    let columns = [("advantage_scale_reward", "reward"), ("advantage_scale_cost", "long-term cost")];
    Chart {
        layers: lines(run, &columns),
        caption: "Mean size of the advantages over the data: what one unit of a scaled advantage is.".to_owned(),
        ..chart(run, "Advantage scales", "scaled reward or cost", Scale::Log)
    }
}

fn speed(run: &RunFolder) -> Chart<'_> {
    let values = run.speed.get("steps_per_second");
    Chart {
        steps: run.speed.get("step"),
        layers: vec![Layer::Line { label: "steps per second".to_owned(), colour: 0, values }],
        caption: "By the wall clock; it depends on what else the machine does.".to_owned(),
        ..chart(run, "Speed", "1/s", Scale::Linear)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::report::tests::run;
    use crate::run::COLUMNS;
    use firmware_sim::page::STYLE;

    /// Columns whose numbers a report of `run` draws.
    fn drawn(run: &RunFolder) -> BTreeSet<&'static str> {
        let values: BTreeSet<*const f64> = sections(run)
            .iter()
            .flat_map(|section| &section.charts)
            .flat_map(|chart| &chart.layers)
            .flat_map(|layer| match layer {
                Layer::Line { values, .. } | Layer::Dots { values, .. } => vec![values.as_ptr()],
                Layer::Area { low, high, .. } => vec![low.as_ptr(), high.as_ptr()],
                Layer::Band { .. } | Layer::Level { .. } => Vec::new(),
            })
            .collect();
        let columns = COLUMNS.iter().skip(1).map(|column| column.name);
        columns.filter(|column| values.contains(&run.metrics.get(column).as_ptr())).collect()
    }

    /// What a guided run draws and what a weighted one does are all columns together; neither
    /// draws what it has not.
    #[test]
    fn every_column_is_drawn_where_a_run_has_it() {
        let (_folder, mut run) = run(3);
        let guided = drawn(&run);
        (run.config.bootstrap, run.config.extraction) = (Bootstrap::InSample, Extraction::Weighted);
        let weighted = drawn(&run);
        assert!(guided.contains("lambda_kappa_0") && !weighted.contains("lambda_kappa_0"), "{guided:?}");
        assert!(weighted.contains("value_loss_reward") && !guided.contains("value_loss_reward"), "{weighted:?}");
        let all: BTreeSet<&str> = COLUMNS.iter().skip(1).map(|column| column.name).collect();
        assert_eq!(&guided | &weighted, all);
    }

    #[test]
    fn every_layer_has_numbers_and_a_style() {
        let (_folder, run) = run(3);
        for section in sections(&run) {
            for chart in section.charts {
                assert!(!chart.caption.is_empty() && !chart.steps.is_empty());
                assert!(chart.layers.iter().any(|layer| !layer.label().is_empty()));
                for layer in chart.layers {
                    assert!(!layer.values().is_empty());
                    let style = format!(".{} {{", layer.class().replace(' ', "."));
                    assert!(STYLE.contains(&style), "{style}");
                }
            }
        }
    }
}
