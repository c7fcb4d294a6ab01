//! AVX-512, for 64-bit x86 processors that have it; found at run time.
//!
//! A tile is two panels high and twelve columns wide: its sums fill 24 of 32
//! vector registers, and each number of the right factor is broadcast for two
//! multiply-adds. The order of a sum is that of [`super`], so are the bits.
#![allow(unsafe_code)]

use core::arch::x86_64::*;

use super::ROWS;
use crate::nn::product::{Operand, Update};

/// Panels of a tile.
const PANELS: usize = 2;

/// The proof that this processor has AVX-512.
#[derive(Clone, Copy, Debug)]
pub(super) struct Avx512(());

impl Avx512 {
    pub(super) fn detect() -> Option<Self> {
        std::arch::is_x86_feature_detected!("avx512f").then_some(Self(()))
    }

    /// Writes the product of the left factor, in panels, and of `b` to `out`, which has `rows` rows.
    ///
    /// # Panics
    /// Unless the dimensions fit.
    pub(super) fn multiply(
        self,
        out: &mut [f32],
        rows: usize,
        panels: &[[f32; ROWS]],
        b: Operand<'_, f32>,
        update: Update<'_, f32>,
    ) {
        let depth = b.rows();
        assert_eq!(panels.len(), rows.div_ceil(ROWS) * depth, "the left factor has a panel for every 16 rows");
        let left = Left { values: panels.as_flattened(), rows, depth, step: ROWS, panel: ROWS * depth };
        // SAFETY: `self` is the proof that the processor has AVX-512, and the panels are as long as was asserted.
        unsafe { multiply(out, left, b, update) }
    }

    /// As [`Avx512::multiply`], with the left factor where it is.
    ///
    /// # Panics
    /// Unless the dimensions fit, and if `a` is transposed.
    pub(super) fn product(self, out: &mut [f32], a: Operand<'_, f32>, b: Operand<'_, f32>, update: Update<'_, f32>) {
        assert!(!a.is_transposed() && a.columns() == b.rows(), "a stored left factor, as deep as the right one");
        let left = Left { values: a.values(), rows: a.rows(), depth: a.columns(), step: a.rows(), panel: ROWS };
        // SAFETY: as above; an operand has all its values.
        unsafe { multiply(out, left, b, update) }
    }
}

/// A left factor: the numbers of `ROWS` neighbouring rows (fewer in the last panel) follow each other.
#[derive(Clone, Copy)]
struct Left<'a> {
    values: &'a [f32],
    rows: usize,
    depth: usize,
    /// From one place of the inner dimension to the next.
    step: usize,
    /// From one panel to the next.
    panel: usize,
}

/// # Safety
/// All numbers that `left` describes lie within its values.
#[target_feature(enable = "avx512f")]
unsafe fn multiply(out: &mut [f32], left: Left<'_>, b: Operand<'_, f32>, update: Update<'_, f32>) {
    assert_eq!(out.len(), left.rows * b.columns(), "the result has rows times columns values");
    assert_eq!(left.depth, b.rows(), "inner dimensions agree");
    if let Update::Plus(other) | Update::Times(other) = update {
        assert_eq!(other.len(), out.len(), "the other matrix is as large as the result");
    }
    for first in (0..left.rows).step_by(PANELS * ROWS) {
        // SAFETY: `first` is a row, and where there is more than a panel below it, a second panel.
        unsafe {
            if left.rows - first > ROWS {
                strip::<PANELS>(out, left, first, b, update);
            } else {
                strip::<1>(out, left, first, b, update);
            }
        }
    }
}

/// All columns of the panels from row `first` on.
///
/// # Safety
/// As [`multiply`]; `P` panels begin at `first` or below it, and `out` and `b` fit.
#[target_feature(enable = "avx512f")]
unsafe fn strip<const P: usize>(
    out: &mut [f32],
    left: Left<'_>,
    first: usize,
    b: Operand<'_, f32>,
    update: Update<'_, f32>,
) {
    // SAFETY: handed on.
    unsafe {
        let at = tiles::<P, 12>(out, left, first, b, update, 0);
        let at = tiles::<P, 8>(out, left, first, b, update, at);
        let at = tiles::<P, 4>(out, left, first, b, update, at);
        let at = tiles::<P, 2>(out, left, first, b, update, at);
        tiles::<P, 1>(out, left, first, b, update, at);
    }
}

/// As many tiles of `C` columns as fit from column `at` on; returns the first column that is left.
///
/// # Safety
/// As [`strip`].
#[target_feature(enable = "avx512f")]
unsafe fn tiles<const P: usize, const C: usize>(
    out: &mut [f32],
    left: Left<'_>,
    first: usize,
    b: Operand<'_, f32>,
    update: Update<'_, f32>,
    mut at: usize,
) -> usize {
    let mut masks = [0; P];
    for (panel, mask) in masks.iter_mut().enumerate() {
        let height = (left.rows - first - panel * ROWS).min(ROWS);
        *mask = (u32::MAX >> (32 - height)) as __mmask16;
    }
    let [inner, across] = b.strides();
    while at + C <= b.columns() {
        let mut sums = [[_mm512_setzero_ps(); P]; C];
        let mut a = left.values.as_ptr().wrapping_add(first / ROWS * left.panel);
        // Every third column has a pointer; the other two are reached by an index. A pointer for each
        // would be more than there are registers, and one for all a chain of additions as long as the loop.
        let mut thirds = [b.values().as_ptr().wrapping_add(at * across); 4];
        for (third, pointer) in thirds.iter_mut().enumerate() {
            *pointer = pointer.wrapping_add(3 * third * across);
        }
        for _ in 0..left.depth {
            let mut rows = [_mm512_setzero_ps(); P];
            for panel in 0..P {
                // SAFETY: the rows of the mask are rows of the left factor.
                rows[panel] = unsafe { _mm512_maskz_loadu_ps(masks[panel], a.wrapping_add(panel * left.panel)) };
            }
            for column in 0..C {
                let place = thirds[column / 3].wrapping_add(column % 3 * across);
                // SAFETY: the place lies within `b`, in column `at + column`.
                let factor = _mm512_set1_ps(unsafe { *place });
                for panel in 0..P {
                    sums[column][panel] = _mm512_fmadd_ps(rows[panel], factor, sums[column][panel]);
                }
            }
            a = a.wrapping_add(left.step);
            thirds = thirds.map(|pointer| pointer.wrapping_add(inner));
            let [p0, p1, p2, p3] = &mut thirds;
            // SAFETY: no instruction; it hides from the compiler that the pointers depend on each other.
            unsafe {
                core::arch::asm!(
                    "/* {0} {1} {2} {3} */",
                    inout(reg) * p0,
                    inout(reg) * p1,
                    inout(reg) * p2,
                    inout(reg) * p3,
                    options(pure, readonly, nostack, preserves_flags),
                );
            }
        }
        for (column, sums) in sums.iter().enumerate() {
            for (panel, (&sum, &mask)) in sums.iter().zip(&masks).enumerate() {
                let start = (at + column) * left.rows + first + panel * ROWS;
                let place = out[start..].as_mut_ptr();
                // SAFETY: the rows of the mask are rows of the column, which ends within `out`; other
                // matrices are as long as `out`.
                unsafe {
                    let value = match update {
                        Update::Replace => sum,
                        Update::Add => _mm512_add_ps(_mm512_maskz_loadu_ps(mask, place), sum),
                        Update::Plus(other) => _mm512_add_ps(_mm512_maskz_loadu_ps(mask, other[start..].as_ptr()), sum),
                        Update::Times(other) => {
                            _mm512_mul_ps(_mm512_maskz_loadu_ps(mask, other[start..].as_ptr()), sum)
                        }
                    };
                    _mm512_mask_storeu_ps(place, mask, value);
                }
            }
        }
        at += C;
    }
    at
}
