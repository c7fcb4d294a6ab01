//! The sinusoidal code of a denoising step (Appendix B).

use nalgebra::DMatrix;

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_level_is_zeros_then_ones_and_frequencies_span_four_decades() {
        let code = sinusoidal_code::<f64>(8, 3);
        assert_eq!(code.column(0).as_slice(), [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]);
        assert_eq!(code[(0, 2)], 2f64.sin());
        assert!((code[(3, 2)] - 2e-4f64.sin()).abs() < 1e-15);
    }
}
