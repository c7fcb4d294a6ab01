//! What a run measures while it learns.

use std::fmt::Write;

use serde::{Deserialize, Serialize};

use crate::learner::Metrics;

/// Steps between rows of `metrics.csv`.
pub(super) const ROW_STEPS: u64 = 100;

/// Columns of `metrics.csv`, and what they mean. All but the first are means over the last 100 steps.
pub const COLUMNS: [(&str, &str); 14] = [
    ("step", "training steps done"),
    ("critic_loss_reward", "loss of the reward heads, summed over the twins (Eq. 4)"),
    ("critic_loss_long_cost", "loss of the long-term cost heads (Eq. 4)"),
    ("critic_loss_short_cost", "loss of the short-term cost heads (Eq. 4)"),
    ("conflicts_0", "share of steps without a pair of trunk gradients in conflict (Table A1)"),
    ("conflicts_1", "share of steps with one pair in conflict"),
    ("conflicts_2", "share of steps with two pairs in conflict"),
    ("conflicts_3", "share of steps with three pairs in conflict"),
    ("cloning_loss", "weighted behaviour cloning (Eq. 13)"),
    ("q_reward", "Q_r at the policy's actions"),
    ("q_long_cost", "Q_cL at the policy's actions"),
    ("lambda", "dual variable at the budgets of the batch"),
    ("penalty", "lambda (Q_cL - kappa) (Eq. 15)"),
    ("counterfactual_active", "share of transitions with a counterfactual weight above 1, at the last step"),
];

/// Sums since the last row.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Window {
    steps: u64,
    sums: [f64; 8],
    conflicts: [u64; 4],
}

impl Window {
    /// Adds one step.
    pub fn push(&mut self, metrics: &Metrics) {
        let Metrics { critic, actor } = metrics;
        let [reward, long, short] = critic.losses;
        let values = [reward, long, short, actor.cloning, actor.reward, actor.long_cost, actor.lambda, actor.penalty];
        self.sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        self.conflicts[critic.conflicts] += 1;
        self.steps += 1;
    }

    /// Whether every loss so far was a finite number.
    pub fn is_finite(&self) -> bool {
        self.sums.iter().all(|sum| sum.is_finite())
    }

    /// Whether a row is due.
    pub const fn is_full(&self) -> bool {
        self.steps >= ROW_STEPS
    }

    /// The row in the order of [`COLUMNS`], and an empty window.
    pub fn take_row(&mut self, step: u64, counterfactual_active: f64) -> String {
        let window = std::mem::take(self);
        let steps = window.steps as f64;
        let [reward, long, short, rest @ ..] = window.sums.map(|sum| sum / steps);
        let conflicts = window.conflicts.map(|count| count as f64 / steps);
        let mut row = step.to_string();
        for value in [reward, long, short].into_iter().chain(conflicts).chain(rest).chain([counterfactual_active]) {
            // Writing to a string cannot fail.
            let _ = write!(row, ",{value}");
        }
        row
    }

    /// Mean cloning loss, mean `Q_r`, mean `Q_cL` and mean lambda since the last row.
    pub fn glance(&self) -> [f64; 4] {
        let [_, _, _, cloning, reward, long_cost, lambda, _] = self.sums;
        [cloning, reward, long_cost, lambda].map(|sum| sum / self.steps.max(1) as f64)
    }
}

/// `metrics.csv`, held in memory and written whole.
#[derive(Clone, Debug)]
pub(super) struct Table {
    text: String,
}

impl Table {
    pub(super) fn new() -> Self {
        let names: Vec<&str> = COLUMNS.iter().map(|(name, _)| *name).collect();
        Self { text: names.join(",") + "\n" }
    }

    /// The rows of an earlier table up to `step`: what came after belongs to work that was lost.
    pub(super) fn until(text: &str, step: u64) -> Self {
        let mut table = Self::new();
        let step_of = |row: &str| row.split(',').next().and_then(|step| step.parse::<u64>().ok());
        text.lines().filter(|row| step_of(row).is_some_and(|at| at <= step)).for_each(|row| table.push(row));
        table
    }

    pub(super) fn push(&mut self, row: &str) {
        self.text.push_str(row);
        self.text.push('\n');
    }

    pub(super) fn text(&self) -> &str {
        &self.text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actor::ActorLoss;
    use crate::update::CriticMetrics;

    fn metrics(cloning: f64, conflicts: usize) -> Metrics {
        let critic = CriticMetrics { losses: [1.0, 2.0, 3.0], conflicts };
        Metrics { critic, actor: ActorLoss { cloning, reward: 5.0, long_cost: 6.0, penalty: 8.0, lambda: 7.0 } }
    }

    #[test]
    fn a_row_holds_the_means_in_the_order_of_the_columns() {
        let mut window = Window::default();
        window.push(&metrics(3.0, 0));
        window.push(&metrics(5.0, 2));
        let row = window.take_row(200, 0.25);
        assert_eq!(row, "200,1,2,3,0.5,0,0.5,0,4,5,6,7,8,0.25");
        assert_eq!(row.split(',').count(), COLUMNS.len());
        assert_eq!(window, Window::default());
    }

    #[test]
    fn a_loss_that_is_no_number_is_noticed() {
        let mut window = Window::default();
        window.push(&metrics(1.0, 0));
        assert!(window.is_finite());
        window.push(&metrics(f64::NAN, 0));
        assert!(!window.is_finite());
    }

    #[test]
    fn rows_beyond_the_checkpoint_are_dropped() {
        let mut table = Table::new();
        ["100,1", "200,2", "300,3"].into_iter().for_each(|row| table.push(row));
        let kept = Table::until(table.text(), 200);
        assert!(kept.text().ends_with("100,1\n200,2\n"));
        assert!(kept.text().starts_with("step,critic_loss_reward"));
    }
}
