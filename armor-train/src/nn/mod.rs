//! Fully connected networks, forward and backward, over flat parameter vectors.
//!
//! A network is a layout ([`Mlp`]) and a vector of numbers. Optimiser, soft
//! update, gradient surgery and checkpoint see only the vector; a layer's
//! weights are a view into it, `outputs x inputs`, column by column, followed by
//! the bias. In every matrix a column is a sample, so a share of a batch is a
//! contiguous piece. Generic over the scalar: training is f32, gradient checks
//! are f64.

mod activation;
mod adam;
mod ahead;
mod kernel;
mod linear;
mod mlp;
mod product;
mod scalar;
mod sinusoid;
mod tape;
mod weights;

pub use activation::Activation;
pub use adam::Adam;
pub use ahead::Ahead;
pub use linear::Linear;
pub use mlp::Mlp;
pub use product::{Operand, Update, product};
pub use scalar::Scalar;
pub use sinusoid::{Frequencies, TimeFrequencies, sinusoidal_code};
pub use tape::{Tape, keep_columns};
pub use weights::{Panels, Passes, Weights};

/// `target <- rate * online + (1 - rate) * target` (Appendix B, tau).
pub fn soft_update<T: Scalar>(target: &mut [T], online: &[T], rate: T) {
    for (target, &online) in target.iter_mut().zip(online) {
        *target += rate * (online - *target);
    }
}

/// Adds `part` to `sum`, entry by entry.
pub fn accumulate<T: Scalar>(sum: &mut [T], part: &[T]) {
    for (sum, &part) in sum.iter_mut().zip(part) {
        *sum += part;
    }
}

/// Scales `gradient` down to the Euclidean norm `limit` where it is longer; a limit of 0 is none.
pub fn clip_norm<T: Scalar>(gradient: &mut [T], limit: f64) {
    let norm = dot(gradient, gradient).sqrt();
    if limit > 0.0 && norm > limit {
        let factor = T::of(limit / norm);
        gradient.iter_mut().for_each(|entry| *entry *= factor);
    }
}

/// The inner product of two parameter-sized vectors, in f64.
pub fn dot<T: Scalar>(a: &[T], b: &[T]) -> f64 {
    // Eight running sums let the loop vectorise; their order is fixed.
    let mut sums = [0.0; 8];
    let (a_chunks, a_rest) = a.as_chunks::<8>();
    let (b_chunks, b_rest) = b.as_chunks::<8>();
    for (a, b) in a_chunks.iter().zip(b_chunks) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a.to_f64() * b.to_f64();
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a.to_f64() * b.to_f64()).sum();
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_gradient_is_shortened_and_a_short_one_kept() {
        let mut gradient = [3.0f64, -4.0];
        clip_norm(&mut gradient, 10.0);
        clip_norm(&mut gradient, 0.0);
        assert_eq!(gradient, [3.0, -4.0]);
        clip_norm(&mut gradient, 1.0);
        assert!((gradient[0] - 0.6).abs() < 1e-12 && (gradient[1] + 0.8).abs() < 1e-12);
    }

    #[test]
    fn the_inner_product_is_that_of_all_entries() {
        let a: Vec<f64> = (0..19).map(f64::from).collect();
        assert_eq!(dot(&a, &a), 18.0 * 19.0 * 37.0 / 6.0);
    }
}
