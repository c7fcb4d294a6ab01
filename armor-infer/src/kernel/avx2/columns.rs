//! Single precision for several columns: a lane is another output, and each
//! vector of weights is multiplied by an input of every column.

use core::arch::x86_64::*;

use super::float::{LANES, load};
use crate::kernel::columns;

/// Columns that have sums in registers in one pass over the weights.
const MOST: usize = 8;

#[target_feature(enable = "avx2")]
pub(super) fn accumulate<const K: usize>(weights: &[f32], x: &[[f32; K]], out: &mut [[f32; K]]) {
    let stride = out.len().max(1);
    // Eight registers of sums, or as many as there are columns.
    let (weights, out) = match K {
        ..=2 => blocks::<4, K>(weights, stride, x, out),
        3..=4 => blocks::<2, K>(weights, stride, x, out),
        _ => (weights, out),
    };
    let (weights, out) = blocks::<1, K>(weights, stride, x, out);
    columns::accumulate_rest(weights, stride, x, out);
}

/// Works on `out` in blocks of `V` registers of outputs; returns the outputs
/// left over, and the weights from their first column on.
#[target_feature(enable = "avx2")]
fn blocks<'w, 'o, const V: usize, const K: usize>(
    mut weights: &'w [f32],
    stride: usize,
    x: &[[f32; K]],
    out: &'o mut [[f32; K]],
) -> (&'w [f32], &'o mut [[f32; K]]) {
    let (whole, rest) = out.split_at_mut(out.len() - out.len() % (V * LANES));
    for block in whole.as_chunks_mut::<LANES>().0.as_chunks_mut::<V>().0 {
        if K <= MOST {
            pass::<V, K, K>(weights, stride, (x, 0), block);
        } else {
            for first in (0..K).step_by(MOST) {
                if first + MOST <= K {
                    pass::<V, MOST, K>(weights, stride, (x, first), block);
                } else {
                    (first..K).for_each(|column| pass::<V, 1, K>(weights, stride, (x, column), block));
                }
            }
        }
        weights = weights.get(V * LANES..).unwrap_or_default();
    }
    (weights, rest)
}

/// The sums of a block in `C` of its columns, from `first` on.
#[inline]
#[target_feature(enable = "avx2")]
fn pass<const V: usize, const C: usize, const K: usize>(
    weights: &[f32],
    stride: usize,
    (x, first): (&[[f32; K]], usize),
    block: &mut [[[f32; K]; LANES]; V],
) {
    let mut sums = [[_mm256_setzero_ps(); C]; V];
    for (sums, outputs) in sums.iter_mut().zip(&*block) {
        for (sum, column) in sums.iter_mut().zip(first..) {
            let mut lanes = [0.0; LANES];
            for (lane, output) in lanes.iter_mut().zip(outputs) {
                *lane = output[column];
            }
            *sum = load(&lanes);
        }
    }
    let rows = weights.chunks(stride).filter_map(|row| row.as_chunks::<LANES>().0.first_chunk::<V>());
    let inputs = x.iter().filter_map(|x| x.get(first..).and_then(<[f32]>::first_chunk::<C>));
    for (x, row) in inputs.zip(rows) {
        for (sums, lanes) in sums.iter_mut().zip(row) {
            let weights = load(lanes);
            for (sum, x) in sums.iter_mut().zip(x) {
                *sum = _mm256_add_ps(*sum, _mm256_mul_ps(_mm256_set1_ps(*x), weights));
            }
        }
    }
    for (sums, outputs) in sums.iter().zip(block) {
        for (sum, column) in sums.iter().zip(first..) {
            let mut lanes = [0.0; LANES];
            // SAFETY: 32 bytes, and no alignment is needed.
            unsafe { _mm256_storeu_ps(lanes.as_mut_ptr(), *sum) };
            for (output, value) in outputs.iter_mut().zip(lanes) {
                output[column] = value;
            }
        }
    }
}
