//! Trajectory-level debiasing (Eqs. 6 and 7).

use crate::data::Dataset;

/// `w_traj = 1 + beta [C_i <= d]` of each trajectory (Eq. 6), with
/// the limit in units of recorded cost.
pub fn weights(data: &Dataset, limit: f32, beta: f64) -> Vec<f32> {
    data.trajectories().iter().map(|trajectory| weight(trajectory.cost_return, limit, beta)).collect()
}

/// The `beta` that gives feasible trajectories, a share `p` of the data, the mass `mass` (Eq. 7).
///
/// At least 0, and 0 where no trajectory is feasible: weights never suppress feasible ones.
pub fn beta_for_mass(p: f64, mass: f64) -> f64 {
    if p == 0.0 { 0.0 } else { (mass * (1.0 - p) / (p * (1.0 - mass)) - 1.0).max(0.0) }
}

fn weight(cost: f32, limit: f32, beta: f64) -> f32 {
    if cost <= limit { (1.0 + beta) as f32 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::feasible_mass;

    #[test]
    fn a_target_mass_is_reached_and_never_by_a_negative_beta() {
        for p in [0.0447, 0.13, 0.4525] {
            assert!((feasible_mass(p, beta_for_mass(p, 0.6)) - 0.6).abs() < 1e-12);
        }
        assert_eq!(beta_for_mass(0.7, 0.6), 0.0);
        assert_eq!(beta_for_mass(0.0, 0.6), 0.0);
    }

    #[test]
    fn only_a_trajectory_within_the_limit_is_raised() {
        assert_eq!(weight(5.0, 5.0, 0.5), 1.5);
        assert_eq!(weight(0.0, 5.0, 0.5), 1.5);
        assert_eq!(weight(6.0, 5.0, 0.5), 1.0);
    }
}
