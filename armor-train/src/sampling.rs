//! Which recorded transitions a batch is drawn from, with replacement.

use std::ops::Range;

use armor_core::noise::below;
use serde::{Deserialize, Serialize};

use crate::data::Dataset;
use crate::stream;

/// What is drawn with equal chances (O-31).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sampling {
    /// Transitions (the paper).
    Uniform,
    /// Trajectories, then one of their transitions: short ones count as much as long ones.
    Trajectory,
    /// Bins of cost returns, then one of their trajectories, then one of its
    /// transitions: a rare cost counts as much as a common one.
    CostBins,
}

/// Bins of equal width between no cost and the largest cost return.
const BINS: usize = 10;

/// The rows that a batch is drawn from.
#[derive(Clone, Debug)]
pub(crate) struct Rows {
    len: usize,
    /// Rows of the trajectories of each bin; none where transitions are drawn uniformly.
    bins: Vec<Vec<Range<usize>>>,
}

impl Rows {
    pub(crate) fn new(sampling: Sampling, data: &Dataset) -> Self {
        let mut bins = match sampling {
            Sampling::Uniform => Vec::new(),
            Sampling::Trajectory => vec![Vec::new()],
            Sampling::CostBins => vec![Vec::new(); BINS],
        };
        if let Some(last) = bins.len().checked_sub(1) {
            let width = f64::from(data.max_kappa()) / bins.len() as f64;
            for trajectory in data.trajectories() {
                let place = f64::from(trajectory.cost_return) / width.max(f64::MIN_POSITIVE);
                bins[(place as usize).min(last)].push(trajectory.rows.clone());
            }
        }
        bins.retain(|bin| !bin.is_empty());
        Self { len: data.len(), bins }
    }

    /// The rows of some trajectories, which have equal chances.
    pub(crate) fn among(trajectories: Vec<Range<usize>>) -> Self {
        Self { len: trajectories.iter().map(ExactSizeIterator::len).sum(), bins: vec![trajectories] }
    }

    /// A row, by a uniform word of each stream that is asked for one.
    pub(crate) fn draw(&self, word: impl Fn(u32) -> u32) -> usize {
        let choose = |stream, count: usize| below(word(stream), count as u32) as usize;
        if self.bins.is_empty() {
            return choose(stream::ROWS, self.len);
        }
        let bin = &self.bins[choose(stream::BINS, self.bins.len())];
        let rows = &bin[choose(stream::TRAJECTORIES, bin.len())];
        rows.start + choose(stream::ROWS, rows.len())
    }
}

#[cfg(test)]
mod tests {
    use armor_core::noise::Noise;

    use super::*;
    use crate::data::Recording;

    /// Trajectories of the given lengths and costs a step.
    fn data(trajectories: &[(usize, f32)]) -> Dataset {
        let mut all = Recording { state_dim: 1, action_dim: 1, ..Recording::default() };
        for &(length, cost) in trajectories {
            all.append(&Recording {
                observations: vec![0.0; length],
                next_observations: vec![0.0; length],
                actions: vec![0.0; length],
                rewards: vec![0.0; length],
                costs: vec![cost; length],
                terminals: vec![false; length],
                timeouts: (1..=length).map(|step| step == length).collect(),
                ..all.clone()
            });
        }
        Dataset::new(all).unwrap()
    }

    /// How often each trajectory is met in 40,000 draws.
    fn shares(sampling: Sampling, data: &Dataset) -> Vec<f64> {
        const DRAWS: u64 = 40_000;
        let (rows, noise) = (Rows::new(sampling, data), Noise::new(5));
        let mut counts = vec![0.0; data.trajectories().len()];
        for tick in 0..DRAWS {
            counts[data.trajectory(rows.draw(|stream| noise.words(stream, tick, 0)[0]))] += 1.0 / DRAWS as f64;
        }
        counts
    }

    #[test]
    fn transitions_trajectories_or_bins_have_equal_chances() {
        // Cost returns 0, 0, 10 and 100: the first two and the third share bins 0 and 1.
        let data = data(&[(10, 0.0), (30, 0.0), (10, 1.0), (50, 2.0)]);
        for (sampling, expected) in [
            (Sampling::Uniform, [0.1, 0.3, 0.1, 0.5]),
            (Sampling::Trajectory, [0.25; 4]),
            (Sampling::CostBins, [1.0 / 6.0, 1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0]),
        ] {
            for (found, expected) in shares(sampling, &data).into_iter().zip(expected) {
                assert!((found - expected).abs() < 0.01, "{sampling:?}: {found}, not {expected}");
            }
        }
    }

    #[test]
    fn data_without_cost_is_one_bin() {
        assert_eq!(Rows::new(Sampling::CostBins, &data(&[(3, 0.0), (2, 0.0)])).bins, [[0..3, 3..5]]);
    }

    #[test]
    fn every_row_of_a_trajectory_is_met() {
        let data = data(&[(4, 0.0), (3, 1.0)]);
        let (rows, noise) = (Rows::new(Sampling::CostBins, &data), Noise::new(5));
        let mut met = [false; 7];
        (0..500).for_each(|tick| met[rows.draw(|stream| noise.words(stream, tick, 0)[0])] = true);
        assert_eq!(met, [true; 7]);
    }
}
