//! Advantage weights with a price on cost ("Lagrangian" advantage-weighted regression).
//!
//! ```text
//! w_b = exp(min(cap, alpha (A_r / s_r - lambda A_cL / s_cL)))          then divided by the mean of the batch
//! ```

use crate::nn::Scalar;

/// Temperature, price and cap of the weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdvantageWeight {
    /// Inverse temperature, `alpha`.
    pub alpha: f64,
    /// Largest logarithm of a weight.
    pub cap: f64,
}

impl AdvantageWeight {
    /// `ln w` of a transition with scaled advantages of reward and long-term cost, at a price `lambda` of cost.
    pub fn log(&self, [reward, cost]: [f32; 2], lambda: f64) -> f64 {
        (self.alpha * (f64::from(reward) - lambda * f64::from(cost))).min(self.cap)
    }
}

/// What the weights of a batch look like.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BatchWeights {
    /// Mean weight before it was divided out.
    pub mean: f64,
    /// Effective sample size `(sum w)^2 / sum w^2` as a share of the batch (Kish).
    pub effective: f64,
}

/// Turns log weights into weights whose mean over the whole batch is 1, share by share.
///
/// The largest is taken out before the exponential: a batch of small weights does not vanish.
pub fn normalise<T: Scalar>(shares: &mut [&mut [T]]) -> BatchWeights {
    let all = || shares.iter().flat_map(|share| share.iter().map(|weight| weight.to_f64()));
    let largest = all().fold(f64::NEG_INFINITY, f64::max);
    let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for log in all() {
        let weight = (log - largest).exp();
        (count, sum, squares) = (count + 1.0, sum + weight, squares + weight * weight);
    }
    let mean = sum / count;
    for weight in shares.iter_mut().flat_map(|share| share.iter_mut()) {
        *weight = T::of((weight.to_f64() - largest).exp() / mean);
    }
    BatchWeights { mean: mean * largest.exp(), effective: sum * sum / squares / count }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_weight_pays_for_reward_charges_for_cost_and_stops_at_its_cap() {
        let weight = AdvantageWeight { alpha: 2.0, cap: 3.0 };
        assert_eq!(weight.log([1.0, 0.25], 2.0), 1.0);
        assert_eq!(weight.log([0.0, 1.0], 2.0), -4.0);
        assert_eq!(weight.log([9.0, 0.0], 2.0), 3.0);
    }

    #[test]
    fn weights_have_mean_one_over_all_shares() {
        let mut shares = [vec![0.0, 2f64.ln()], vec![5f64.ln()]];
        let found = normalise(&mut shares.each_mut().map(|share| &mut share[..]));
        for (weight, expected) in shares.concat().into_iter().zip([0.375, 0.75, 1.875]) {
            assert!((weight - expected).abs() < 1e-12);
        }
        assert!((found.mean - 8.0 / 3.0).abs() < 1e-12);
        assert!((found.effective - 64.0 / 30.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn weights_too_small_for_the_number_type_still_have_mean_one() {
        let mut share = [-2000.0f32, -2000.0 + 3f32.ln()];
        normalise(&mut [&mut share]);
        assert!((share[0] - 0.5).abs() < 1e-4 && (share[1] - 1.5).abs() < 1e-4);
    }
}
