//! AVX-512 (F, BW, DQ, VL), for 64-bit x86 processors that have it; found at
//! run time, with VNNI where that is there as well.
//!
//! As in `avx2`, a lane is another output in single precision, and what
//! integers must match is every rounding.
#![allow(unsafe_code)]

mod columns;
mod float;
mod integer;

use armor_core::fixed::SHORT_BITS;

use super::avx2::Avx2;

/// The proof that this processor has AVX-512.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Avx512 {
    /// Sums of integer products, where there is no VNNI.
    avx2: Avx2,
    vnni: bool,
}

impl Avx512 {
    /// The kernel without and with VNNI, as far as this processor has them.
    pub(super) fn detect() -> impl Iterator<Item = Self> {
        let has = std::arch::is_x86_feature_detected!("avx512f")
            && std::arch::is_x86_feature_detected!("avx512bw")
            && std::arch::is_x86_feature_detected!("avx512dq")
            && std::arch::is_x86_feature_detected!("avx512vl");
        let plain = Avx2::detect().filter(|_| has).map(|avx2| Self { avx2, vnni: false });
        let vnni = std::arch::is_x86_feature_detected!("avx512vnni");
        plain.into_iter().chain(plain.filter(|_| vnni).map(|plain| Self { vnni: true, ..plain }))
    }

    pub(super) const fn name(self) -> &'static str {
        if self.vnni { "avx512-vnni" } else { "avx512" }
    }

    pub(super) fn accumulate(self, weights: &[f32], x: &[f32], out: &mut [f32]) {
        // SAFETY: `self` is the proof that the processor has AVX-512.
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
        if !self.vnni {
            return self.avx2.sum_rows(weights, codes, bits, sums);
        }
        // SAFETY: as above, and the processor has VNNI.
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
