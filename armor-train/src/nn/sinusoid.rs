//! The sinusoidal code of a denoising step (Appendix B).

use std::f64::consts::TAU;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::Scalar;

/// The codes of the noise levels `1..=steps` as columns, `dim x steps`:
/// sines, then cosines, of `(n - 1) f_i` with frequencies
/// `f_i = exp(-i ln(10000) / (dim / 2 - 1))`. `dim` is even and at least 4.
pub fn sinusoidal_code<T: Scalar>(dim: usize, steps: usize) -> DMatrix<T> {
    let half = dim / 2;
    DMatrix::from_fn(dim, steps, |row, column| {
        let frequency = (-((row % half) as f64) * 10_000f64.ln() / (half - 1) as f64).exp();
        let angle = column as f64 * frequency;
        T::of(if row < half { angle.sin() } else { angle.cos() })
    })
}

/// What the frequencies of a step's code are (O-9).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TimeFrequencies {
    /// Those of [`sinusoidal_code`] (the paper).
    Geometric,
    /// Learnt with the network, from random ones (FISOR's Fourier features).
    Learned,
}

/// Standard deviation of learnt frequencies at the start, in turns a noise level.
const SPREAD: f64 = 0.2;

/// Frequencies that are learnt: their place among the parameters, `count` of them.
///
/// The code of level `n` is then sines, then cosines, of `2 pi f_i (n - 1)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Frequencies {
    /// How many.
    pub count: usize,
    /// The first one's place.
    pub offset: usize,
}

impl Frequencies {
    /// One past the last parameter.
    pub const fn end(&self) -> usize {
        self.offset + self.count
    }

    /// Uniform frequencies of standard deviation 0.2, from draws in `[0, 1)`.
    pub fn initialise<T: Scalar>(&self, parameters: &mut [T], draws: &mut impl Iterator<Item = f64>) {
        for (parameter, draw) in parameters[self.offset..self.end()].iter_mut().zip(draws) {
            *parameter = T::of(SPREAD * 3f64.sqrt() * (2.0 * draw - 1.0));
        }
    }

    /// The codes of all levels as columns of `code`, `2 count x steps`.
    pub fn code<T: Scalar>(&self, parameters: &[T], code: &mut DMatrix<T>) {
        for (level, mut column) in code.column_iter_mut().enumerate() {
            for (i, frequency) in parameters[self.offset..self.end()].iter().enumerate() {
                let angle = TAU * frequency.to_f64() * level as f64;
                (column[i], column[self.count + i]) = (T::of(angle.sin()), T::of(angle.cos()));
            }
        }
    }

    /// Adds the gradient of the frequencies to `gradient`, from that of the code that they gave.
    pub fn add_gradient<T: Scalar>(&self, code: &DMatrix<T>, code_gradient: &DMatrix<T>, gradient: &mut [T]) {
        for (level, (code, slope)) in code.column_iter().zip(code_gradient.column_iter()).enumerate() {
            let turn = T::of(TAU * level as f64);
            for (i, gradient) in gradient[self.offset..self.end()].iter_mut().enumerate() {
                let cosine = self.count + i;
                *gradient += turn * (code[cosine] * slope[i] - code[i] * slope[cosine]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_gradient, fill};

    #[test]
    fn the_gradient_of_learnt_frequencies_is_that_of_finite_differences() {
        let frequencies = Frequencies { count: 3, offset: 2 };
        let (parameters, seed) = (fill(5, 1), DMatrix::from_vec(6, 4, fill(24, 2)));
        let code = |parameters: &[f64]| {
            let mut code = DMatrix::zeros(6, 4);
            frequencies.code(parameters, &mut code);
            code
        };
        let mut gradient = vec![0.0; 5];
        frequencies.add_gradient(&code(&parameters), &seed, &mut gradient);
        assert_gradient(&parameters, &gradient, |parameters| code(parameters).dot(&seed));
        assert!(gradient[..2].iter().all(|g| *g == 0.0) && gradient[2..].iter().all(|g| *g != 0.0));
    }

    #[test]
    fn the_first_level_is_zeros_then_ones_and_frequencies_span_four_decades() {
        let code = sinusoidal_code::<f64>(8, 3);
        assert_eq!(code.column(0).as_slice(), [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]);
        assert_eq!(code[(0, 2)], 2f64.sin());
        assert!((code[(3, 2)] - 2e-4f64.sin()).abs() < 1e-15);
    }
}
