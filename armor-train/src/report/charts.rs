//! Which charts a report holds.

mod actor;
mod critic;
mod weights;

use firmware_sim::page::axis::Scale;
use firmware_sim::page::chart::{Chart, Layer};

use super::folder::RunFolder;
use crate::critic::bootstrap::Bootstrap;
use crate::extraction::Extraction;
use crate::phase::Phase;

/// Charts under one heading.
pub(super) struct Section<'a> {
    pub(super) title: &'static str,
    pub(super) charts: Vec<Chart<'a>>,
}

/// All charts of a run, but those of what it does not have.
pub(super) fn sections(run: &RunFolder) -> Vec<Section<'_>> {
    let in_sample = run.config.bootstrap == Bootstrap::InSample;
    let weighted = run.config.extraction == Extraction::Weighted;
    let state_values = in_sample.then(|| critic::state_value_losses(run));
    let advantages = weighted.then(|| [weights::of_batches(run), weights::advantage_scales(run)]);
    let dual = (!weighted).then(|| [actor::lambda(run), actor::penalty(run)]);
    let judging = rows_of_critics(run);
    let critic = [critic::losses(run)].into_iter().chain(state_values);
    let critic = critic.chain([critic::rewards(run), critic::costs(run)]).map(|chart| until(chart, judging));
    let surgery = [critic::conflicts(run), critic::trunk_norms(run)].map(|chart| until(chart, judging));
    let actor = [actor::cloning(run)].into_iter().chain(dual.into_iter().flatten()).chain([actor::norms(run)]);
    let reweighting = [weights::all(run), weights::active(run)].into_iter().chain(advantages.into_iter().flatten());
    vec![
        Section { title: "Critic", charts: critic.collect() },
        Section { title: "Gradient surgery", charts: surgery.into() },
        Section { title: if weighted { "Actor" } else { "Actor and dual" }, charts: actor.collect() },
        Section { title: "Reweighting", charts: reweighting.collect() },
        Section { title: "Speed", charts: vec![speed(run)] },
    ]
}

/// The leading rows of `metrics.csv` in which critics are trained: all, unless they are frozen on the way.
fn rows_of_critics(run: &RunFolder) -> usize {
    let steps = run.metrics.get("step");
    let before = |row: usize| if row == 0 { 0.0 } else { steps[row - 1] };
    (0..steps.len()).take_while(|&row| Phase::of(&run.config, before(row) as u64).trains_critics()).count()
}

/// The chart of the first rows alone.
fn until(mut chart: Chart<'_>, rows: usize) -> Chart<'_> {
    chart.steps = &chart.steps[..rows];
    for layer in &mut chart.layers {
        match layer {
            Layer::Line { values, .. } | Layer::Dots { values, .. } => *values = &values[..rows],
            Layer::Area { low, high, .. } => (*low, *high) = (&low[..rows], &high[..rows]),
            Layer::Band { .. } | Layer::Level { .. } => {}
        }
    }
    chart
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

    /// Rows in which they are frozen hold no numbers of them.
    #[test]
    fn charts_of_critics_end_where_they_freeze() {
        let (_folder, mut run) = run(3);
        let rows = run.metrics.get("step").len();
        let lengths = |run: &RunFolder| -> BTreeSet<usize> {
            let critics = sections(run).into_iter().take(2).flat_map(|section| section.charts);
            critics.flat_map(|chart| [chart.steps.len(), chart.layers[chart.layers.len() - 1].values().len()]).collect()
        };
        assert_eq!(lengths(&run), BTreeSet::from([rows]));
        run.config.critic_steps = run.metrics.get("step")[1] as u64;
        assert!(rows > 2);
        assert_eq!(lengths(&run), BTreeSet::from([2]));
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
