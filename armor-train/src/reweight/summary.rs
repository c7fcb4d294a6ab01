//! The weights of all transitions in a few numbers.

use super::Weights;
use crate::data::Sorted;

/// How the weights are spread over the data.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WeightSummary {
    /// Share of transitions that the last refresh raised (Eq. 8).
    pub active: f64,
    /// `w` (Eq. 10) at the quantiles [`WeightSummary::QUANTILES`].
    pub quantiles: [f64; 7],
}

impl WeightSummary {
    /// The quantiles, from the smallest weight to the largest.
    pub const QUANTILES: [f64; 7] = [0.0, 0.1, 0.5, 0.9, 0.95, 0.99, 1.0];

    /// Counts all weights.
    pub fn new(weights: &Weights) -> Self {
        let sorted = Sorted::new(weights.combined.iter().copied());
        Self { active: weights.active, quantiles: Self::QUANTILES.map(|q| sorted.quantile(q)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn activity_is_that_of_the_last_refresh_and_quantiles_are_of_the_combined() {
        let weights = Weights { trajectory: vec![1.0; 5], combined: vec![5.0, 1.0, 2.0, 3.0, 4.0], active: 0.4 };
        let summary = WeightSummary::new(&weights);
        assert_eq!(summary.active, 0.4);
        let expected = [1.0, 1.4, 3.0, 4.6, 4.8, 4.96, 5.0];
        for (quantile, expected) in summary.quantiles.iter().zip(expected) {
            assert!((quantile - expected).abs() < 1e-12);
        }
    }
}
