//! AVX2, for 64-bit x86 processors that have it; found at run time.
//!
//! In single precision each lane is another output, and fused multiply-add
//! stays off. Integers are exact, so their order is free; what must match is
//! every rounding.
#![allow(unsafe_code)]

mod columns;
mod float;
mod integer;

use armor_core::fixed::SHORT_BITS;

/// The proof that this processor has AVX2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Avx2(());

impl Avx2 {
    pub(super) fn detect() -> Option<Self> {
        std::arch::is_x86_feature_detected!("avx2").then_some(Self(()))
    }

    pub(super) fn accumulate(self, weights: &[f32], x: &[f32], out: &mut [f32]) {
        // SAFETY: `self` is the proof that the processor has AVX2.
        unsafe { float::accumulate(weights, x, out) }
    }

    pub(super) fn accumulate_columns<const K: usize>(self, weights: &[f32], x: &[[f32; K]], out: &mut [[f32; K]]) {
        // SAFETY: as above.
        unsafe { columns::accumulate(weights, x, out) }
    }

    pub(super) fn mish(self, values: &mut [f32]) {
        // SAFETY: as above.
        unsafe { float::mish(values) }
    }

    pub(super) fn sum_rows(self, weights: &[i8], codes: &[i16], bits: u32, sums: &mut [i32]) {
        // SAFETY: as above.
        unsafe {
            if bits == SHORT_BITS {
                integer::sum_rows_short(weights, codes, sums);
            } else {
                integer::sum_rows_long(weights, codes, sums);
            }
        }
    }

    pub(super) fn rescale(self, sums: &mut [i32], bits: u32, multiplier: &[i32], factor: i32, bias: &[i32]) {
        // SAFETY: as above.
        unsafe { integer::rescale(sums, bits, multiplier, factor, bias) }
    }

    pub(super) fn activate(self, pre: &[i32], factor: i32, bits: u32, codes: &mut [i16]) {
        // SAFETY: as above.
        unsafe { integer::activate(pre, factor, bits, codes) }
    }
}
