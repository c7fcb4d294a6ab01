//! Charts of what transitions weigh.

use firmware_sim::page::axis::Scale;
use firmware_sim::page::chart::{Chart, Layer};

use super::{chart, lines};
use crate::report::folder::RunFolder;

pub(super) fn all(run: &RunFolder) -> Chart<'_> {
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

pub(super) fn active(run: &RunFolder) -> Chart<'_> {
    Chart {
        layers: lines(run, &[("counterfactual_active", "active")]),
        caption: "Transitions with a counterfactual weight above 1 (Eq. 9).".to_owned(),
        ..chart(run, "Active counterfactual weights", "share of transitions", Scale::Linear)
    }
}

pub(super) fn of_batches(run: &RunFolder) -> Chart<'_> {
    let columns = [("advantage_weight_mean", "mean weight"), ("advantage_weight_effective", "effective share")];
    Chart {
        layers: lines(run, &columns),
        caption: "Advantage weights of a batch: their mean before it is divided out, and the share of the batch that they leave effective."
            .to_owned(),
        ..chart(run, "Advantage weights", "weight, share of the batch", Scale::Log)
    }
}

pub(super) fn advantage_scales(run: &RunFolder) -> Chart<'_> {
    let columns = [("advantage_scale_reward", "reward"), ("advantage_scale_cost", "long-term cost")];
    Chart {
        layers: lines(run, &columns),
        caption: "Mean size of the advantages over the data: what one unit of a scaled advantage is.".to_owned(),
        ..chart(run, "Advantage scales", "scaled reward or cost", Scale::Log)
    }
}
