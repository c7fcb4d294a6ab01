//! Options that stand for numbers of the data.

use serde::{Deserialize, Serialize};

use super::Config;
use crate::data::{Dataset, Perturbation, Trajectory};

/// What decides the factor on rewards (O-4).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RewardUnit {
    /// `reward_scale` as it is given.
    Given,
    /// `T / (R_max - R_min)`, the longest trajectory over the range of the data's returns (FISOR).
    ReturnRange,
}

/// What decides the factor on kappa where it enters a network (O-8).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum KappaUnit {
    /// `kappa_scale` as it is given.
    Given,
    /// 1 over the cost limit.
    Limit,
    /// 1 over the data's largest kappa.
    Largest,
}

impl Config {
    /// The configuration with the numbers that `data` gives `reward_scale` and `kappa_scale`;
    /// resolved again it stays as it is. What has no range, or no cost, leaves the number given.
    #[must_use]
    pub fn resolved(&self, data: &Dataset) -> Self {
        let reward_scale = match self.reward_unit {
            RewardUnit::Given => None,
            RewardUnit::ReturnRange => {
                let returns = || data.trajectories().iter().map(|trajectory| trajectory.reward_return);
                let range = returns().fold(f64::NEG_INFINITY, f64::max) - returns().fold(f64::INFINITY, f64::min);
                let longest = data.trajectories().iter().map(|Trajectory { rows, .. }| rows.len()).max();
                longest.map(|longest| longest as f64 / range)
            }
        };
        let kappa_scale = match self.kappa_unit {
            KappaUnit::Given => None,
            KappaUnit::Limit => Some(1.0 / (self.limit * self.cost_scale)),
            KappaUnit::Largest => Some(1.0 / (f64::from(data.max_kappa()) * self.cost_scale)),
        };
        let or_given = |scale: Option<f64>, given| scale.filter(|scale| scale.is_finite()).unwrap_or(given);
        Self {
            reward_scale: or_given(reward_scale, self.reward_scale),
            kappa_scale: or_given(kappa_scale, self.kappa_scale),
            ..self.clone()
        }
    }

    /// The faults that are put into the data.
    pub const fn perturbation(&self) -> Perturbation {
        Perturbation { reward_noise: self.reward_noise, cost_errors: self.cost_errors }
    }
}

#[cfg(test)]
mod tests {
    use crate::config::Preset;
    use crate::testing::recording;

    /// The scales of rewards and kappa under two options.
    fn scales(options: &[&str]) -> [f64; 2] {
        // Returns 0, 5 and 10; cost returns 0, 5 and 0.
        let data = recording(3, 5, |row| (row / 5) as f32, |row| f32::from(row / 5 == 1));
        let mut config = Preset::Paper.config("own", 4.0);
        options.iter().for_each(|option| config.set(option).unwrap());
        let resolved = config.resolved(&data);
        assert_eq!(resolved.resolved(&data), resolved);
        [resolved.reward_scale, resolved.kappa_scale]
    }

    #[test]
    fn scales_are_those_given_or_those_of_the_data() {
        assert_eq!(scales(&[]), [0.1, 1.0]);
        assert_eq!(scales(&["reward_unit=return_range"]), [0.5, 1.0]);
        assert_eq!(scales(&["kappa_unit=limit", "cost_scale=0.5"]), [0.1, 0.5]);
        assert_eq!(scales(&["kappa_unit=largest", "cost_scale=0.5"]), [0.1, 0.4]);
    }

    #[test]
    fn data_without_range_or_cost_leaves_the_scales_given() {
        let data = recording(2, 3, |_| 1.0, |_| 0.0);
        let mut config = Preset::Paper.config("own", 1.0);
        config.set("reward_unit=return_range").unwrap();
        config.set("kappa_unit=largest").unwrap();
        let resolved = config.resolved(&data);
        assert_eq!((resolved.reward_scale, resolved.kappa_scale), (0.1, 1.0));
    }
}
