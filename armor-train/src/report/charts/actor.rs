//! Charts of the actor and the dual.

use firmware_sim::page::axis::{Scale, label};
use firmware_sim::page::chart::{Chart, Layer};

use super::{chart, lines};
use crate::data::Sorted;
use crate::report::folder::RunFolder;

pub(super) fn cloning(run: &RunFolder) -> Chart<'_> {
    let entries = run.provenance.action_entries as f64;
    let mut layers = vec![Layer::Level { label: format!("no prediction ({entries})"), at: entries }];
    layers.extend(lines(run, &[("cloning_loss", "behaviour cloning")]));
    Chart {
        layers,
        caption: "Weighted error of the predicted noise (Eq. 13). It jumps where the weights are refreshed.".to_owned(),
        ..chart(run, "Cloning loss", "noise variance, all action entries", Scale::Log)
    }
}

pub(super) fn lambda(run: &RunFolder) -> Chart<'_> {
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

pub(super) fn penalty(run: &RunFolder) -> Chart<'_> {
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

pub(super) fn norms(run: &RunFolder) -> Chart<'_> {
    let columns = [("gradient_critic", "critic"), ("gradient_actor", "actor"), ("gradient_dual", "dual")];
    Chart {
        layers: lines(run, &columns),
        caption: "What the optimisers saw.".to_owned(),
        ..chart(run, "Gradients", "norm", Scale::Log)
    }
}
