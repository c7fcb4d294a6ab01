//! Adam (Kingma and Ba 2015), the optimiser of all three networks.

use serde::{Deserialize, Serialize};

use super::Scalar;

const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.999;
const EPSILON: f64 = 1e-8;

/// Moments of one parameter vector.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Adam<T: Scalar> {
    rate: f64,
    steps: u64,
    first: Vec<T>,
    second: Vec<T>,
}

impl<T: Scalar> Adam<T> {
    /// Zero moments for `len` parameters at learning rate `rate`.
    pub fn new(len: usize, rate: f64) -> Self {
        Self { rate, steps: 0, first: vec![T::zero(); len], second: vec![T::zero(); len] }
    }

    /// Replaces the learning rate.
    pub fn set_rate(&mut self, rate: f64) {
        self.rate = rate;
    }

    /// The learning rate.
    pub const fn rate(&self) -> f64 {
        self.rate
    }

    /// One bias-corrected descent step along `gradient`.
    pub fn descend(&mut self, parameters: &mut [T], gradient: &[T]) {
        self.steps += 1;
        let steps = self.steps as f64;
        let correction_1 = 1.0 - BETA_1.powf(steps);
        let correction_2 = 1.0 - BETA_2.powf(steps);
        let step_size = T::of(self.rate / correction_1);
        let root_correction = T::of(1.0 / correction_2.sqrt());
        let [beta_1, beta_2, epsilon] = [BETA_1, BETA_2, EPSILON].map(T::of);
        let [rest_1, rest_2] = [1.0 - BETA_1, 1.0 - BETA_2].map(T::of);
        let moments = self.first.iter_mut().zip(&mut self.second);
        for ((parameter, &gradient), (first, second)) in parameters.iter_mut().zip(gradient).zip(moments) {
            *first = beta_1 * *first + rest_1 * gradient;
            *second = beta_2 * *second + rest_2 * gradient * gradient;
            *parameter -= step_size * *first / (second.sqrt() * root_correction + epsilon);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With a constant gradient the corrected moments are `g` and `g^2`, so each step is `rate * sign(g)`.
    #[test]
    fn a_constant_gradient_moves_by_the_learning_rate() {
        let mut adam = Adam::new(2, 0.1);
        let mut parameters = [1.0f64, -1.0];
        for _ in 0..5 {
            adam.descend(&mut parameters, &[3.0, -0.2]);
        }
        assert!((parameters[0] - 0.5).abs() < 1e-6);
        assert!((parameters[1] + 0.5).abs() < 1e-6);
    }
}
