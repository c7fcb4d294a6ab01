//! Mean and standard deviation of the states, for standardising them (O-5).

use super::dataset::Dataset;

/// What a state entry's deviation must exceed, relative to its mean or to 1,
/// to count as varying: a few times the resolution of f32. Below it the entry
/// is constant up to rounding, and dividing by its deviation would turn
/// rounding into signal.
const CONSTANT: f64 = 1e-6;

/// Per-entry moments of the states of a data set, each of length `S`.
#[derive(Clone, Debug, PartialEq)]
pub struct StateMoments {
    /// Means.
    pub mean: Vec<f32>,
    /// Standard deviations (of the population); 1 for a constant entry, so that it is only shifted.
    pub std: Vec<f32>,
    /// The entries that are constant up to rounding.
    pub constant: Vec<usize>,
}

impl StateMoments {
    /// The moments over all rows, in two passes and f64.
    pub fn new(dataset: &Dataset) -> Self {
        let rows = dataset.len() as f64;
        let mut mean = vec![0.0f64; dataset.state_dim()];
        for row in 0..dataset.len() {
            for (sum, &value) in mean.iter_mut().zip(dataset.observation(row)) {
                *sum += f64::from(value);
            }
        }
        mean.iter_mut().for_each(|sum| *sum /= rows);

        let mut variance = vec![0.0f64; dataset.state_dim()];
        for row in 0..dataset.len() {
            for ((sum, &value), mean) in variance.iter_mut().zip(dataset.observation(row)).zip(&mean) {
                *sum += (f64::from(value) - mean).powi(2);
            }
        }
        let mut constant = Vec::new();
        let std = variance.iter().zip(&mean).enumerate().map(|(entry, (sum, mean))| {
            let std = (sum / rows).sqrt();
            if std > CONSTANT * mean.abs().max(1.0) {
                return std as f32;
            }
            constant.push(entry);
            1.0
        });
        let std = std.collect();
        Self { mean: mean.into_iter().map(|mean| mean as f32).collect(), std, constant }
    }
}
