//! What the short-term cost is held against in Eq. 8.
//!
//! With a cost of 0 or 1 and a discount of 0.3, `Q_cS` stays below 1.43, so
//! against kappa the margin lives only where kappa is 0 or 1, and at 0 only where
//! noise in `Q_cS` lets it. The realised short-horizon cost keeps it alive.

use serde::{Deserialize, Serialize};

use crate::data::Dataset;

/// The bound on `Q_cS`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reference {
    /// Kappa (the paper).
    Kappa,
    /// What the trajectory itself incurred over the short horizon, `sum_k gamma_cS^k c_{t+k}`.
    Realised,
}

/// The bound of every transition, in units of scaled cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Bounds {
    /// What the trajectory incurs from each row on, by [`Reference::Realised`]; empty for kappa, which the data holds.
    realised: Vec<f64>,
    reference: Reference,
    tolerance: f64,
    cost_scale: f64,
}

impl Bounds {
    /// The bounds of all transitions: the reference, plus `tolerance` in units of recorded cost.
    pub fn new(data: &Dataset, reference: Reference, discount: f64, tolerance: f64, cost_scale: f64) -> Self {
        let realised = match reference {
            Reference::Kappa => Vec::new(),
            Reference::Realised => realised(data, discount),
        };
        Self { realised, reference, tolerance, cost_scale }
    }

    /// The bound of a transition of the same data.
    pub fn bound(&self, data: &Dataset, row: usize) -> f64 {
        let reference = match self.reference {
            Reference::Kappa => f64::from(data.kappa(row)),
            Reference::Realised => self.realised[row],
        };
        self.cost_scale * (reference + self.tolerance)
    }
}

fn realised(data: &Dataset, discount: f64) -> Vec<f64> {
    let mut sums = vec![0.0; data.len()];
    for trajectory in data.trajectories() {
        let mut sum = 0.0;
        for row in trajectory.rows.clone().rev() {
            sum = f64::from(data.cost(row)) + discount * sum;
            sums[row] = sum;
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::dataset;

    #[test]
    fn the_paper_takes_kappa_and_the_option_the_discounted_cost_to_come() {
        let bounds = |reference| {
            let data = dataset();
            let bounds = Bounds::new(&data, reference, 0.5, 0.1, 2.0);
            [0, 1, 2, 3].map(|row| bounds.bound(&data, row))
        };
        // The first trajectory costs 1, 0, 1; the second nothing.
        assert_eq!(bounds(Reference::Kappa), [2.0, 1.0, 1.0, 0.0].map(|kappa| 2.0 * (kappa + 0.1)));
        assert_eq!(bounds(Reference::Realised), [1.25, 0.5, 1.0, 0.0].map(|cost| 2.0 * (cost + 0.1)));
    }
}
