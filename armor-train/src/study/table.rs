//! A study's answer: a row a variant.

use std::fmt::Write;

use super::{Score, Study};

/// The scores of a variant's runs, seed by seed.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Name of the variant.
    pub variant: String,
    /// A score for each seed.
    pub scores: Vec<Score>,
}

impl Row {
    /// Mean reward, mean cost and largest cost over the seeds, of flight `index`.
    fn flight(&self, index: usize) -> [f64; 3] {
        let flights = || self.scores.iter().filter_map(|score| score.flights.get(index));
        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / self.scores.len().max(1) as f64;
        [
            mean(&mut flights().map(|flown| flown.reward_normalized)),
            mean(&mut flights().map(|flown| flown.cost_normalized)),
            flights().map(|flown| flown.cost_normalized).fold(0.0, f64::max),
        ]
    }

    /// Seeds whose flight `index` cost at most the limit.
    fn safe(&self, index: usize) -> usize {
        let is_safe = |score: &&Score| score.flights.get(index).is_some_and(|flown| flown.cost_normalized <= 1.0);
        self.scores.iter().filter(is_safe).count()
    }

    /// Mean of column `index` over the seeds.
    fn column(&self, index: usize) -> f64 {
        let values = self.scores.iter().filter_map(|score| score.columns.get(index));
        values.sum::<f64>() / self.scores.len().max(1) as f64
    }
}

/// The table in Markdown: for each flight mean reward / mean cost (largest cost
/// of a seed) and the seeds that were safe, then the columns' means.
pub fn markdown(study: &Study, rows: &[Row]) -> String {
    let mut text = String::from("| variant |");
    for steps in &study.max_steps {
        let _ = write!(text, " {steps} steps: reward / cost (worst) | safe |");
    }
    for column in &study.columns {
        let _ = write!(text, " {column} |");
    }
    text.push_str("\n|---|");
    text.push_str(&"---|".repeat(2 * study.max_steps.len() + study.columns.len()));
    for row in rows {
        let _ = write!(text, "\n| {} |", row.variant);
        for index in 0..study.max_steps.len() {
            let [reward, cost, worst] = row.flight(index);
            let safe = row.safe(index);
            let _ = write!(text, " {reward:.3} / {cost:.2} ({worst:.2}) | {safe} of {} |", row.scores.len());
        }
        for index in 0..study.columns.len() {
            let _ = write!(text, " {} |", short(row.column(index)));
        }
    }
    text.push('\n');
    text
}

/// Three significant digits.
fn short(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude != 0.0 && !(1e-3..1e4).contains(&magnitude) {
        return format!("{value:.2e}");
    }
    let digits = if magnitude == 0.0 { 0 } else { (2 - magnitude.log10().floor() as i32).max(0) };
    format!("{value:.*}", digits as usize)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::study::Flown;

    #[test]
    fn a_row_holds_means_over_seeds_the_worst_cost_and_how_many_were_safe() {
        let text = "title = '?'\ntask = 'ball-run'\nseeds = [0, 1]\nepisodes = 1\nmax_steps = [20, 5]\n\
                    columns = ['lambda']\n[[variant]]\nname = 'a'";
        let study = Study::parse(Path::new("s.toml"), text).unwrap();
        let score = |reward: f64, cost: f64, lambda: f64| Score {
            of: String::new(),
            flights: [20, 5]
                .map(|max_steps| Flown {
                    max_steps,
                    reward_normalized: reward,
                    cost_normalized: cost / max_steps as f64,
                })
                .to_vec(),
            columns: vec![lambda],
        };
        let rows = [Row { variant: "a".into(), scores: vec![score(0.2, 4.0, 100.0), score(0.3, 10.0, 23.4)] }];
        let expected = "| variant | 20 steps: reward / cost (worst) | safe | 5 steps: reward / cost (worst) | safe | lambda |\n\
                        |---|---|---|---|---|---|\n\
                        | a | 0.250 / 0.35 (0.50) | 2 of 2 | 0.250 / 1.40 (2.00) | 1 of 2 | 61.7 |\n";
        assert_eq!(markdown(&study, &rows), expected);
    }

    #[test]
    fn numbers_have_three_digits() {
        let expected = ["0", "0.500", "61.7", "-148", "0.00123", "1.23e-4", "1.20e5"];
        assert_eq!([0.0, 0.5, 61.72, -148.4, 0.001_234, 1.234e-4, 120_000.0].map(short), expected);
    }
}
