//! The number type of a network.

use nalgebra::RealField;
use serde::{Serialize, de::DeserializeOwned};

use super::Ahead;
use super::kernel::{self, ROWS};
use super::product::{Operand, Packed, Update};

/// f32 to train, f64 to check.
pub trait Scalar: RealField + Copy + Serialize + DeserializeOwned + 'static {
    /// `mish(x)` and its derivative.
    fn mish_with_derivative(self) -> (Self, Self);
    /// `value <- mish(value + bias)`, entry by entry.
    fn mish_column(values: &mut [Self], bias: &[Self]) {
        for (value, &bias) in values.iter_mut().zip(bias) {
            *value = (*value + bias).mish_with_derivative().0;
        }
    }
    /// As [`Scalar::mish_column`], and writes the derivative to `slopes`.
    fn mish_column_with_slopes(values: &mut [Self], slopes: &mut [Self], bias: &[Self]) {
        for ((value, slope), &bias) in values.iter_mut().zip(slopes).zip(bias) {
            (*value, *slope) = (*value + bias).mish_with_derivative();
        }
    }
    /// The nearest value of this type.
    fn of(value: f64) -> Self;
    /// The value in double precision.
    fn to_f64(self) -> f64;
    /// Writes the product of a left factor of `rows` rows, in panels, and of `b` to `out`, and may fetch
    /// what is `ahead`.
    fn multiply(
        out: &mut [Self],
        rows: usize,
        panels: &[[Self; ROWS]],
        b: Operand<'_, Self>,
        update: Update<'_, Self>,
        _ahead: &Ahead,
    ) {
        kernel::multiply(out, rows, panels, b, update, |a, b, sum| a * b + sum);
    }
    /// Writes the product of `a` and `b` to `out`, and may fetch what is `ahead`.
    fn product(out: &mut [Self], a: Operand<'_, Self>, b: Operand<'_, Self>, update: Update<'_, Self>, ahead: &Ahead) {
        Packed::new(a).multiply(out, b, update, ahead);
    }
    /// Exchanges rows and columns of a block.
    fn transpose(block: &mut [[Self; ROWS]; ROWS]) {
        kernel::transpose(block);
    }
    /// The value of a recorded number.
    fn of_f32(value: f32) -> Self {
        Self::of(f64::from(value))
    }
}

impl Scalar for f32 {
    #[inline(always)]
    fn mish_with_derivative(self) -> (Self, Self) {
        armor_core::mish::mish_with_derivative(self)
    }
    fn mish_column(values: &mut [Self], bias: &[Self]) {
        vectorised::mish_column(values, bias);
    }
    fn mish_column_with_slopes(values: &mut [Self], slopes: &mut [Self], bias: &[Self]) {
        vectorised::mish_column_with_slopes(values, slopes, bias);
    }
    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    fn multiply(
        out: &mut [Self],
        rows: usize,
        panels: &[[Self; ROWS]],
        b: Operand<'_, Self>,
        update: Update<'_, Self>,
        ahead: &Ahead,
    ) {
        kernel::multiply_f32(out, rows, panels, b, update, ahead);
    }
    fn product(out: &mut [Self], a: Operand<'_, Self>, b: Operand<'_, Self>, update: Update<'_, Self>, ahead: &Ahead) {
        kernel::product_f32(out, a, b, update, ahead);
    }
    fn transpose(block: &mut [[Self; ROWS]; ROWS]) {
        kernel::transpose_f32(block);
    }
}

impl Scalar for f64 {
    #[inline(always)]
    fn mish_with_derivative(self) -> (Self, Self) {
        let e = self.min(40.0).exp();
        let n = e * (e + 2.0);
        let tanh = n / (n + 2.0);
        (self * tanh, tanh + self * 4.0 * (e / (n + 2.0)) * ((e + 1.0) / (n + 2.0)))
    }
    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }
}

/// The f32 loops, compiled for wider vectors as well and chosen at run time;
/// without contraction the bits are the same at every width.
mod vectorised {
    use armor_core::mish::{mish, mish_with_derivative};
    use multiversion::multiversion;

    #[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
    pub(super) fn mish_column(values: &mut [f32], bias: &[f32]) {
        for (value, &bias) in values.iter_mut().zip(bias) {
            *value = mish(*value + bias);
        }
    }

    #[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
    pub(super) fn mish_column_with_slopes(values: &mut [f32], slopes: &mut [f32], bias: &[f32]) {
        for ((value, slope), &bias) in values.iter_mut().zip(slopes).zip(bias) {
            (*value, *slope) = mish_with_derivative(*value + bias);
        }
    }
}
