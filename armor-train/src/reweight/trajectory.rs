//! Trajectory-level debiasing (Eqs. 6 and 7).

use crate::data::Dataset;

/// `w_traj = 1 + beta [C_i <= d]` of each transition's trajectory (Eq. 6), with
/// the limit in units of recorded cost.
pub fn weights(data: &Dataset, limit: f32, beta: f64) -> Vec<f32> {
    (0..data.len()).map(|row| weight(data.trajectory_cost(row), limit, beta)).collect()
}

fn weight(cost: f32, limit: f32, beta: f64) -> f32 {
    if cost <= limit { (1.0 + beta) as f32 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_trajectory_within_the_limit_is_raised() {
        assert_eq!(weight(5.0, 5.0, 0.5), 1.5);
        assert_eq!(weight(0.0, 5.0, 0.5), 1.5);
        assert_eq!(weight(6.0, 5.0, 0.5), 1.0);
    }
}
