//! Multi-scale reweighting (section 3.3): which recorded transitions the actor
//! is to imitate most.

pub mod counterfactual;
pub mod reference;
mod refresh;
mod scale;
mod summary;
pub mod trajectory;

use crate::data::Dataset;
use crate::nn::Scalar;

pub use refresh::Reweighting;
pub use scale::{Averaged, MarginMean, Scales, WeightMean};
pub use summary::WeightSummary;

/// Guards the division by a mean of zero (Eqs. 9 and 10).
pub const EPSILON: f64 = 1e-6;

/// When the weights are active and refreshed (Table 2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refresh {
    /// Training steps before the first refresh; all weights are 1 until then.
    pub warmup: u64,
    /// Training steps between refreshes.
    pub interval: u64,
}

impl Refresh {
    /// Whether the weights are refreshed before training step `step`, counted from 0.
    pub const fn is_due(&self, step: u64) -> bool {
        step >= self.warmup && (step - self.warmup).is_multiple_of(self.interval)
    }

    /// Refreshes before `steps` training steps were done.
    pub const fn done(&self, steps: u64) -> u64 {
        if steps > self.warmup { (steps - self.warmup - 1) / self.interval + 1 } else { 0 }
    }
}

/// The weights of all transitions.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    /// `w_traj` of each trajectory (Eq. 6).
    pub trajectory: Vec<f32>,
    /// `w` of each transition (Eq. 10); all 1 before the first refresh.
    pub combined: Vec<f32>,
    /// Share of the transitions with a margin above 0 (Eq. 8) at the last refresh.
    pub active: f64,
}

impl Weights {
    /// Weights before the first refresh; `beta` is that of Eq. 6.
    pub fn ones(data: &Dataset, limit: f32, beta: f64) -> Self {
        let trajectory = trajectory::weights(data, limit, beta);
        Self { trajectory, combined: vec![1.0; data.len()], active: 0.0 }
    }

    /// Eq. 10 over the whole data: `w = clip(w_traj w_cf / (E[w_traj w_cf] + eps), w_min, w_max)`,
    /// with `counterfactual`, `w_cf` of each transition.
    pub fn combine(&mut self, data: &Dataset, counterfactual: &[f32], [low, high]: [f64; 2]) {
        // Written in place: the weights of all transitions are not held twice.
        let mut combined = std::mem::take(&mut self.combined);
        let mean = (0..data.len()).map(|row| self.product(data, counterfactual, row)).sum::<f64>() / data.len() as f64;
        for (row, weight) in combined.iter_mut().enumerate() {
            *weight = (self.product(data, counterfactual, row) / (mean + EPSILON)).clamp(low, high) as f32;
        }
        self.combined = combined;
    }

    /// `w_traj w_cf` of a transition, before Eq. 10.
    pub fn product(&self, data: &Dataset, counterfactual: &[f32], row: usize) -> f64 {
        f64::from(self.trajectory[data.trajectory(row)]) * f64::from(counterfactual[row])
    }
}

/// Eq. 10 over the products `w_traj w_cf` of a batch, share by share: divided by their mean, then
/// clipped to `[low, high]`.
pub fn normalise<T: Scalar>(shares: &mut [&mut [T]], [low, high]: [f64; 2]) {
    let values = || shares.iter().flat_map(|share| share.iter().map(|weight| weight.to_f64()));
    let mean = values().sum::<f64>() / values().count() as f64;
    for weight in shares.iter_mut().flat_map(|share| share.iter_mut()) {
        *weight = T::of((weight.to_f64() / (mean + EPSILON)).clamp(low, high));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::recording;

    /// Eq. 10 for trajectories of one transition each.
    fn combined(trajectory: &[f32], counterfactual: &[f32], clip: [f64; 2]) -> Vec<f32> {
        let data = recording(trajectory.len(), 1, |_| 0.0, |_| 0.0);
        let mut weights = Weights { trajectory: trajectory.to_vec(), ..Weights::ones(&data, 1.0, 0.0) };
        weights.combine(&data, counterfactual, clip);
        weights.combined
    }

    #[test]
    fn the_papers_settings_refresh_thirty_six_times() {
        let refresh = Refresh { warmup: 20_000, interval: 5_000 };
        let due: Vec<u64> = (0..200_000).filter(|&step| refresh.is_due(step)).collect();
        assert_eq!((due.len(), due[0], due[35]), (36, 20_000, 195_000));
    }

    #[test]
    fn refreshes_done_are_those_that_were_due() {
        for (warmup, interval) in [(0, 1), (0, 3), (7, 5), (4, 1)] {
            let refresh = Refresh { warmup, interval };
            for steps in 0..30 {
                assert_eq!(refresh.done(steps), (0..steps).filter(|&step| refresh.is_due(step)).count() as u64);
            }
        }
    }

    #[test]
    fn weights_have_mean_one_before_the_clip() {
        let weights = combined(&[1.5, 1.0, 1.0, 1.0], &[1.0, 1.2, 1.0, 2.0], [0.0, 10.0]);
        let mean = weights.iter().sum::<f32>() / 4.0;
        assert!((mean - 1.0).abs() < 1e-5);
        let ratio = weights[3] / weights[2];
        assert!((ratio - 2.0).abs() < 1e-6);
    }

    #[test]
    fn a_batch_has_the_weights_of_data_that_hold_nothing_else() {
        let (trajectory, counterfactual) = ([1.5, 1.0, 1.0, 1.0], [1.0, 1.2, 1.0, 8.0]);
        let expected = combined(&trajectory, &counterfactual, [0.5, 2.0]);
        let mut shares = [vec![1.5f64, 1.2], vec![1.0, 8.0]];
        normalise(&mut shares.each_mut().map(|share| &mut share[..]), [0.5, 2.0]);
        for (found, expected) in shares.concat().into_iter().zip(expected) {
            assert!((found - f64::from(expected)).abs() < 1e-6);
        }
    }

    #[test]
    fn weights_are_clipped() {
        let weights = combined(&[1.0; 5], &[1.0, 1.0, 1.0, 1.0, 20.0], [0.8, 2.0]);
        assert_eq!(weights, [0.8, 0.8, 0.8, 0.8, 2.0]);
    }
}
