//! Element-wise functions between layers, fused with the bias.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::Scalar;

/// The function between layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Activation {
    /// `x tanh(ln(1 + e^x))`: actor and critic (Appendix B).
    Mish,
    /// `max(0, x)`: the dual network (Appendix B).
    Relu,
    /// `ln(1 + e^x)`: an output that is never negative (O-7).
    Softplus,
}

impl Activation {
    /// Adds `bias` to each column of `values`, as long as it, then applies the function in
    /// place; where `slopes` are given, writes the derivative to them.
    pub fn apply<T: Scalar>(self, values: &mut [T], slopes: Option<&mut [T]>, bias: &[T]) {
        self.apply_columns(values, slopes, bias.len(), std::iter::repeat(bias));
    }

    /// As [`Activation::apply`], with a bias for each column: that of its noise level, column `n - 1` of `table`.
    pub fn apply_by_level<T: Scalar>(
        self,
        values: &mut [T],
        slopes: Option<&mut [T]>,
        table: &DMatrix<T>,
        levels: &[usize],
    ) {
        let rows = table.nrows();
        let biases = levels.iter().map(|level| &table.as_slice()[(level - 1) * rows..level * rows]);
        self.apply_columns(values, slopes, rows, biases);
    }

    fn apply_columns<'a, T: Scalar>(
        self,
        values: &mut [T],
        slopes: Option<&mut [T]>,
        rows: usize,
        biases: impl Iterator<Item = &'a [T]>,
    ) {
        let columns = values.chunks_exact_mut(rows).zip(biases);
        match (self, slopes) {
            (Self::Mish, None) => columns.for_each(|(values, bias)| T::mish_column(values, bias)),
            (Self::Mish, Some(slopes)) => columns
                .zip(slopes.chunks_exact_mut(rows))
                .for_each(|((values, bias), slopes)| T::mish_column_with_slopes(values, slopes, bias)),
            (Self::Softplus, slopes) => {
                let mut slopes = slopes.map(|slopes| slopes.iter_mut());
                for (values, bias) in columns {
                    for (value, &bias) in values.iter_mut().zip(bias) {
                        let sum = *value + bias;
                        // `e^-|x|` cannot overflow.
                        let tail = (-sum.abs()).exp();
                        *value = sum.max(T::zero()) + tail.ln_1p();
                        if let Some(slope) = slopes.as_mut().and_then(Iterator::next) {
                            let part = if sum > T::zero() { T::one() } else { tail };
                            *slope = part / (T::one() + tail);
                        }
                    }
                }
            }
            (Self::Relu, None) => columns.for_each(|(values, bias)| {
                values.iter_mut().zip(bias).for_each(|(value, &bias)| *value = (*value + bias).max(T::zero()));
            }),
            (Self::Relu, Some(slopes)) => {
                for ((values, bias), slopes) in columns.zip(slopes.chunks_exact_mut(rows)) {
                    for ((value, slope), &bias) in values.iter_mut().zip(slopes).zip(bias) {
                        let sum = *value + bias;
                        (*value, *slope) = if sum > T::zero() { (sum, T::one()) } else { (T::zero(), T::zero()) };
                    }
                }
            }
        }
    }
}
