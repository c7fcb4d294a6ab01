//! What the trajectories cost that a policy imitates.
//!
//! ```text
//! J(x) = sum_t w_x,t C_i(t) / sum_t w_x,t
//! ```
//!
//! `w_x` is the weight that a transition is cloned with at leniency `x`, and
//! `C_i` the cost return of its trajectory. The estimate is free of any model,
//! and blind to what the policy makes of the pieces: it takes every trajectory
//! for flown to its end as recorded.

use crate::data::Dataset;
use crate::extraction::cloning::Cloning;

/// `J` in units of recorded cost at each leniency.
pub fn costs(cloning: &Cloning, data: &Dataset, leniencies: &[f64]) -> Vec<f64> {
    let cost = |&leniency: &f64| {
        let (sum, weights) = (0..data.len()).fold((0.0, 0.0), |(sum, weights), row| {
            let weight = cloning.log_weight(row, leniency).exp();
            (sum + weight * f64::from(data.trajectory_cost(row)), weights + weight)
        });
        sum / weights
    };
    leniencies.iter().map(cost).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Preset;
    use crate::extraction::advantage::Advantages;
    use crate::extraction::condition::Condition;
    use crate::testing::dataset;

    /// The first trajectory costs 2 and its actions have a cost advantage of 1, the second costs
    /// nothing and has one of -1: the weights are `exp(-alpha lambda)` and `exp(alpha lambda)`.
    #[test]
    fn a_stricter_policy_imitates_the_cheaper_trajectory() {
        let mut config = Preset::Quick.config("own", 1.0);
        (config.condition, config.advantage_temperature, config.advantage_cap) = (Condition::Lambda, 1.0, 9.0);
        (config.lambda_min, config.lambda_max) = (0.1, 2.0);
        let scaled = (0..6).map(|row| [0.0, if row < 3 { 1.0 } else { -1.0 }]).collect();
        let cloning = Cloning::new(&config, Advantages { scaled, scales: [1.0; 2] });
        let found = costs(&cloning, &dataset(), &[0.0, 1.0]);
        for (found, lambda) in found.iter().zip([2.0f64, 0.1]) {
            let expected = 2.0 / (1.0 + (2.0 * lambda).exp());
            assert!((found - expected).abs() < 1e-9, "{found} is not {expected}");
        }
    }
}
