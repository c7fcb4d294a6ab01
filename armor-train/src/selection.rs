//! Which of a run's actors flies, chosen without a simulator (O-24).

use serde::{Deserialize, Serialize};

use crate::nn::Scalar;

/// Which actor of a run is exported.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Choice {
    /// That of the last step (the paper).
    Last,
    /// That after the [`PERIOD`] steps whose mean cloning loss was the smallest.
    CloningLoss,
}

/// Steps that a cloning loss is averaged over.
pub const PERIOD: u64 = 500;

/// The best actor so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Selection<T: Scalar> {
    steps: u64,
    sum: f64,
    lowest: Option<f64>,
    /// Its weights; empty while none was chosen.
    pub actor: Vec<T>,
}

impl<T: Scalar> Default for Selection<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Scalar> Selection<T> {
    /// None so far.
    pub const fn new() -> Self {
        Self { steps: 0, sum: 0.0, lowest: None, actor: Vec::new() }
    }

    /// Takes in the cloning loss of a step and the actor after it.
    pub fn push(&mut self, loss: f64, actor: &[T]) {
        (self.steps, self.sum) = (self.steps + 1, self.sum + loss);
        if self.steps < PERIOD {
            return;
        }
        let mean = self.sum / self.steps as f64;
        if self.lowest.is_none_or(|lowest| mean < lowest) {
            self.lowest = Some(mean);
            self.actor = actor.to_vec();
        }
        (self.steps, self.sum) = (0, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_actor_after_the_best_period_is_kept() {
        let mut selection = Selection::new();
        for (period, loss) in [3.0, 1.0, 2.0, 1.5].into_iter().enumerate() {
            for step in 0..PERIOD {
                // A single step below all others does not count.
                let loss = if step == 7 { 0.0 } else { loss };
                selection.push(loss, &[period as f64, step as f64]);
            }
        }
        assert_eq!(selection.actor, [1.0, (PERIOD - 1) as f64]);
    }

    #[test]
    fn before_a_whole_period_none_is_chosen() {
        let mut selection = Selection::new();
        (1..PERIOD).for_each(|_| selection.push(1.0, &[1.0f64]));
        assert!(selection.actor.is_empty());
    }
}
