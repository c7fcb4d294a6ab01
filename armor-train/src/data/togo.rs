//! What the data says of the values that a critic estimates.

use serde::{Deserialize, Serialize};

use super::dataset::Dataset;
use super::sorted::Sorted;

/// Discounted sums from each row to the end of its trajectory, in scaled units:
/// the critic's value of the recorded behaviour is their mean, so a sound
/// critic stays near their range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ToGo {
    /// The smallest.
    pub min: f64,
    /// 5 % quantile.
    pub p5: f64,
    /// Median.
    pub p50: f64,
    /// 95 % quantile.
    pub p95: f64,
    /// The largest.
    pub max: f64,
}

impl ToGo {
    /// `G_t = x_t + discount G_{t+1}` of every row, 0 after a trajectory's last (O-3);
    /// `signal` gives a row's scaled reward or cost.
    pub fn new(data: &Dataset, discount: f64, signal: impl Fn(usize) -> f64) -> Self {
        let mut sums = Vec::with_capacity(data.len());
        for trajectory in data.trajectories() {
            let mut sum = 0.0;
            sums.extend(trajectory.rows.clone().rev().map(|row| {
                sum = signal(row) + discount * sum;
                sum
            }));
        }
        let sorted = Sorted::new(sums.into_iter());
        let [min, p5, p50, p95, max] = [0.0, 0.05, 0.5, 0.95, 1.0].map(|q| sorted.quantile(q));
        Self { min, p5, p50, p95, max }
    }

    /// The largest distance of a value from 0.
    pub fn largest(&self) -> f64 {
        self.min.abs().max(self.max.abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::recording;

    #[test]
    fn sums_are_discounted_and_stop_at_the_end_of_a_trajectory() {
        let data = recording(2, 3, |row| row as f32, |_| 0.0);
        let sums = ToGo::new(&data, 0.5, |row| 10.0 * f64::from(data.reward(row)));
        // Rows to go: 0 + 5 + 5 = 10, 10 + 10 = 20, 20; 30 + 20 + 12.5 = 62.5, 40 + 25 = 65, 50.
        assert_eq!((sums.min, sums.p50, sums.max), (10.0, 35.0, 65.0));
        assert_eq!(sums.largest(), 65.0);
        assert_eq!(ToGo::new(&data, 0.5, |_| -1.0).largest(), 1.75);
    }
}
