//! Expectile regression (Newey and Powell 1987), which in-sample critics learn their state values by.

use crate::nn::Scalar;

/// The asymmetric squared loss `|tau - [u < 0]| u^2` of an error `u = y - v`, and its derivative in `u`.
///
/// Its minimiser over `v` is the `tau`-expectile of `y`: the mean at 0.5, towards the largest
/// `y` above it, towards the smallest below it.
pub(super) fn expectile_loss<T: Scalar>(tau: f64, error: T) -> (T, T) {
    let factor = T::of(if error < T::zero() { 1.0 - tau } else { tau });
    let slope = factor * error;
    (slope * error, slope + slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The minimiser over a grid of step 1e-4 of the summed loss of `sample`.
    fn expectile(tau: f64, sample: &[f64]) -> f64 {
        let loss = |v: f64| sample.iter().map(|y| expectile_loss(tau, y - v).0).sum::<f64>();
        let grid = (0..=120_000).map(|i| -1.0 + f64::from(i) * 1e-4);
        grid.min_by(|a, b| loss(*a).total_cmp(&loss(*b))).unwrap()
    }

    /// The expectile `v` balances `(1 - tau) sum_{y < v} (v - y) = tau sum_{y > v} (y - v)`.
    #[test]
    fn the_minimiser_is_the_expectile() {
        let sample = [0.0, 1.0, 2.0, 10.0];
        // tau = 0.5 is the mean.
        assert!((expectile(0.5, &sample) - 3.25).abs() < 1e-4);
        // 0.3 (3 v - 3) = 0.7 (10 - v)
        assert!((expectile(0.7, &sample) - 7.9 / 1.6).abs() < 1e-4);
        // 0.9 (2 v - 1) = 0.1 (12 - 2 v)
        assert!((expectile(0.1, &sample) - 2.1 / 2.0).abs() < 1e-4);
    }

    #[test]
    fn the_derivative_is_that_of_the_loss() {
        for tau in [0.1, 0.5, 0.9] {
            for error in [-2.0, -0.3, 0.4, 3.0f64] {
                let loss = |error| expectile_loss::<f64>(tau, error).0;
                let slope = (loss(error + 1e-6) - loss(error - 1e-6)) / 2e-6;
                assert!((expectile_loss(tau, error).1 - slope).abs() < 1e-8);
            }
        }
    }
}
