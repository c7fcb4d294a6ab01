//! Recordings with faults put in on purpose: how much a run suffers from sensors
//! that are not accurate, which the paper leaves open (section 5).

use armor_core::noise::{Noise, uniform};

use super::dataset::Dataset;
use crate::stream;

/// Faults of the sensors of reward and cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Perturbation {
    /// Standard deviation of the noise on each reward, in standard deviations of the recorded rewards.
    pub reward_noise: f64,
    /// Share of steps whose cost is misread: a cost is missed, or where there is none the
    /// mean of the recorded positive costs is seen.
    pub cost_errors: f64,
}

impl Perturbation {
    /// Whether nothing is changed.
    pub fn is_none(&self) -> bool {
        self.reward_noise == 0.0 && self.cost_errors == 0.0
    }
}

impl Dataset {
    /// The same data seen by faulty sensors; kappa and all returns follow from what they saw.
    ///
    /// The faults of a row depend on the seed and the row alone.
    #[must_use]
    pub fn perturbed(&self, perturbation: Perturbation, seed: u64) -> Self {
        let mut data = self.clone();
        let noise = Noise::new(seed);
        let spread = perturbation.reward_noise * deviation(self);
        let charge = mean_charge(self);
        for row in 0..data.len() {
            let mut draw = [0.0f32];
            stream::fill_normal(noise, stream::REWARD_NOISE, row as u64, &mut draw);
            let (reward, cost) = data.signals_mut(row);
            *reward += (spread * f64::from(draw[0])) as f32;
            let [word, ..] = noise.words(stream::COST_ERRORS, row as u64, 0);
            if f64::from(uniform(word)) < perturbation.cost_errors {
                *cost = if *cost > 0.0 { 0.0 } else { charge };
            }
        }
        data.count_again();
        data
    }
}

/// Standard deviation of the recorded rewards.
fn deviation(data: &Dataset) -> f64 {
    let rewards = || (0..data.len()).map(|row| f64::from(data.reward(row)));
    let mean = rewards().sum::<f64>() / data.len() as f64;
    (rewards().map(|reward| (reward - mean).powi(2)).sum::<f64>() / data.len() as f64).sqrt()
}

/// Mean of the recorded positive costs; 1 where there are none.
fn mean_charge(data: &Dataset) -> f32 {
    let costs = || (0..data.len()).map(|row| data.cost(row)).filter(|&cost| cost > 0.0);
    match costs().count() {
        0 => 1.0,
        count => (costs().map(f64::from).sum::<f64>() / count as f64) as f32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{dataset, recording};

    const NONE: Perturbation = Perturbation { reward_noise: 0.0, cost_errors: 0.0 };

    #[test]
    fn without_faults_the_data_stays_as_it_is() {
        assert!(NONE.is_none());
        assert_eq!(dataset().perturbed(NONE, 1), dataset());
    }

    #[test]
    fn rewards_gain_the_variance_that_was_asked_for_and_no_mean() {
        let data = recording(40, 100, |row| if row % 2 == 0 { 3.0 } else { -3.0 }, |_| 0.0);
        let noisy = data.perturbed(Perturbation { reward_noise: 0.5, ..NONE }, 7);
        let added = || (0..data.len()).map(|row| f64::from(noisy.reward(row) - data.reward(row)));
        let mean = added().sum::<f64>() / data.len() as f64;
        let deviation = (added().map(|x| x * x).sum::<f64>() / data.len() as f64).sqrt();
        // Of 4,000 draws with a deviation of 1.5.
        assert!(mean.abs() < 0.1 && (deviation - 1.5).abs() < 0.1, "{mean}, {deviation}");
        let first = &noisy.trajectories()[0];
        let sum: f64 = first.rows.clone().map(|row| f64::from(noisy.reward(row))).sum();
        assert_eq!(first.reward_return, sum);
    }

    #[test]
    fn every_cost_misread_is_every_cost_swapped_and_kappa_is_what_was_seen() {
        // The first trajectory costs 1, 0, 1, the second nothing.
        let swapped = dataset().perturbed(Perturbation { cost_errors: 1.0, ..NONE }, 1);
        assert_eq!([0, 1, 2, 3, 4, 5].map(|row| swapped.cost(row)), [0.0, 1.0, 0.0, 1.0, 1.0, 1.0]);
        assert_eq!([0, 1, 2, 3, 4, 5].map(|row| swapped.kappa(row)), [1.0, 1.0, 0.0, 3.0, 2.0, 1.0]);
        assert_eq!(swapped.trajectory_cost(5), 3.0);
        let some = recording(40, 100, |_| 0.0, |_| 0.0).perturbed(Perturbation { cost_errors: 0.25, ..NONE }, 1);
        let seen = (0..some.len()).filter(|&row| some.cost(row) > 0.0).count();
        assert!((900..1100).contains(&seen), "{seen}");
    }

    #[test]
    fn the_seed_decides_the_faults() {
        let faults = Perturbation { reward_noise: 1.0, cost_errors: 0.5 };
        assert_eq!(dataset().perturbed(faults, 3), dataset().perturbed(faults, 3));
        assert_ne!(dataset().perturbed(faults, 3), dataset().perturbed(faults, 4));
    }
}
