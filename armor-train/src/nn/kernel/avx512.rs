//! AVX-512, for 64-bit x86 processors that have it; found at run time.
//!
//! A tile is two panels high and twelve columns wide: its sums fill 24 of 32
//! vector registers, and each number of the right factor is broadcast for two
//! multiply-adds. The order of a sum is that of [`super`], so are the bits.
#![allow(unsafe_code)]

mod transpose;

use core::arch::x86_64::*;

use super::ROWS;
use crate::nn::Ahead;
use crate::nn::product::{Operand, Update};

/// Panels of a tile.
const PANELS: usize = 2;

/// What becomes of a sum on its way to the result; known when a tile is compiled.
const REPLACE: u8 = 0;
const PLUS: u8 = 1;
const TIMES: u8 = 2;

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
        ahead: &Ahead,
    ) {
        let depth = b.rows();
        assert_eq!(panels.len(), rows.div_ceil(ROWS) * depth, "the left factor has a panel for every 16 rows");
        let left = Left { values: panels.as_flattened(), rows, depth, step: ROWS, panel: ROWS * depth };
        // SAFETY: `self` is the proof that the processor has AVX-512, and the panels are as long as was asserted.
        unsafe { multiply(out, left, b, update, ahead) }
    }

    /// As [`Avx512::multiply`], with the left factor where it is.
    ///
    /// # Panics
    /// Unless the dimensions fit, and if `a` is transposed.
    pub(super) fn product(
        self,
        out: &mut [f32],
        a: Operand<'_, f32>,
        b: Operand<'_, f32>,
        update: Update<'_, f32>,
        ahead: &Ahead,
    ) {
        assert!(!a.is_transposed() && a.columns() == b.rows(), "a stored left factor, as deep as the right one");
        let left = Left { values: a.values(), rows: a.rows(), depth: a.columns(), step: a.rows(), panel: ROWS };
        // SAFETY: as above; an operand has all its values.
        unsafe { multiply(out, left, b, update, ahead) }
    }

    /// Exchanges rows and columns of a block.
    pub(super) fn transpose(self, block: &mut [[f32; ROWS]; ROWS]) {
        // SAFETY: `self` is the proof that the processor has AVX-512.
        unsafe { transpose::transpose(block) }
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

/// Where the sums go, column by column, what they are joined with on their way, and what is fetched meanwhile.
#[derive(Clone, Copy)]
struct Target<'a> {
    out: *mut f32,
    /// As large as the result, and perhaps the result itself.
    other: *const f32,
    ahead: &'a Ahead,
}

/// # Safety
/// All numbers that `left` describes lie within its values.
#[target_feature(enable = "avx512f")]
unsafe fn multiply(out: &mut [f32], left: Left<'_>, b: Operand<'_, f32>, update: Update<'_, f32>, ahead: &Ahead) {
    assert_eq!(out.len(), left.rows * b.columns(), "the result has rows times columns values");
    assert_eq!(left.depth, b.rows(), "inner dimensions agree");
    if let Update::Plus(other) | Update::Times(other) = update {
        assert_eq!(other.len(), out.len(), "the other matrix is as large as the result");
    }
    let out = out.as_mut_ptr();
    // SAFETY: the result and the other matrix have as many values as was asserted.
    unsafe {
        match update {
            Update::Replace => strips::<REPLACE>(Target { out, other: out, ahead }, left, b),
            Update::Add => strips::<PLUS>(Target { out, other: out, ahead }, left, b),
            Update::Multiply => strips::<TIMES>(Target { out, other: out, ahead }, left, b),
            Update::Plus(other) => strips::<PLUS>(Target { out, other: other.as_ptr(), ahead }, left, b),
            Update::Times(other) => strips::<TIMES>(Target { out, other: other.as_ptr(), ahead }, left, b),
        }
    }
}

/// # Safety
/// As [`multiply`]; the target is as high as the left factor and as wide as `b`.
#[target_feature(enable = "avx512f")]
unsafe fn strips<const UPDATE: u8>(target: Target<'_>, left: Left<'_>, b: Operand<'_, f32>) {
    for first in (0..left.rows).step_by(PANELS * ROWS) {
        // SAFETY: `first` is a row, and where there is more than a panel below it, a second panel.
        unsafe {
            if left.rows - first > ROWS {
                strip::<UPDATE, PANELS>(target, left, first, b);
            } else {
                strip::<UPDATE, 1>(target, left, first, b);
            }
        }
    }
}

/// All columns of the panels from row `first` on.
///
/// # Safety
/// As [`strips`]; `P` panels begin at `first` or below it.
#[target_feature(enable = "avx512f")]
unsafe fn strip<const UPDATE: u8, const P: usize>(
    target: Target<'_>,
    left: Left<'_>,
    first: usize,
    b: Operand<'_, f32>,
) {
    // SAFETY: handed on.
    unsafe {
        let at = tiles::<UPDATE, P, 12>(target, left, first, b, 0);
        let at = tiles::<UPDATE, P, 8>(target, left, first, b, at);
        let at = tiles::<UPDATE, P, 4>(target, left, first, b, at);
        let at = tiles::<UPDATE, P, 2>(target, left, first, b, at);
        tiles::<UPDATE, P, 1>(target, left, first, b, at);
    }
}

/// As many tiles of `C` columns as fit from column `at` on; returns the first column that is left.
///
/// # Safety
/// As [`strip`].
#[target_feature(enable = "avx512f")]
unsafe fn tiles<const UPDATE: u8, const P: usize, const C: usize>(
    target: Target<'_>,
    left: Left<'_>,
    first: usize,
    b: Operand<'_, f32>,
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
        if UPDATE != REPLACE {
            // What the sums are joined with comes from afar while they are computed.
            for column in 0..C {
                for panel in 0..P {
                    let place = (at + column) * left.rows + first + panel * ROWS;
                    _mm_prefetch::<_MM_HINT_T0>(target.other.wrapping_add(place).cast());
                }
            }
        }
        // A quarter of a line for each place of the inner dimension; without work, lines that are at hand.
        let mut ahead = target.ahead.next(left.depth / 4).map_or(a, core::ptr::without_provenance);
        for _ in 0..left.depth {
            _mm_prefetch::<_MM_HINT_T1>(ahead.cast());
            ahead = ahead.wrapping_add(4);
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
        // Plain loops become a straight line, and the sums stay in their registers.
        #[expect(clippy::needless_range_loop, reason = "an iterator over sums takes their address")]
        for column in 0..C {
            for panel in 0..P {
                let (sum, mask) = (sums[column][panel], masks[panel]);
                let place = (at + column) * left.rows + first + panel * ROWS;
                // SAFETY: the rows of the mask are rows of the column, which lies within the target.
                unsafe {
                    let other = target.other.wrapping_add(place);
                    let value = match UPDATE {
                        PLUS => _mm512_add_ps(_mm512_maskz_loadu_ps(mask, other), sum),
                        TIMES => _mm512_mul_ps(_mm512_maskz_loadu_ps(mask, other), sum),
                        _ => sum,
                    };
                    _mm512_mask_storeu_ps(target.out.wrapping_add(place), mask, value);
                }
            }
        }
        at += C;
    }
    at
}
