//! Several columns at once, for every machine: the weights are read once for
//! all of them.

use armor_core::image::Layout;

use super::Kernel;
/// Outputs whose sums are taken side by side. A compiler vectorises over the columns.
const BLOCK: usize = 4;
/// Rows of 8-bit weights that all columns are summed over before the next: few enough for a first-level cache.
const GROUP: usize = 8 * Layout::BLOCK;

/// [`Kernel::accumulate_columns`].
#[inline(always)]
pub(super) fn accumulate<const K: usize>(weights: &[f32], x: &[[f32; K]], out: &mut [[f32; K]]) {
    accumulate_rest(weights, out.len().max(1), x, out);
}

/// [`accumulate`] of the last outputs of a matrix that has `stride` of them;
/// `weights` starts at their first column.
#[inline(always)]
pub(super) fn accumulate_rest<const K: usize>(weights: &[f32], stride: usize, x: &[[f32; K]], out: &mut [[f32; K]]) {
    let (weights, out) = blocks::<BLOCK, K>(weights, stride, x, out);
    // In a single pass: the time of a few sums is the latency of one.
    match out.len() {
        1 => blocks::<1, K>(weights, stride, x, out),
        2 => blocks::<2, K>(weights, stride, x, out),
        3 => blocks::<3, K>(weights, stride, x, out),
        _ => (weights, out),
    };
}

/// Works on `out` in blocks of `B` outputs; returns the outputs left over, and
/// the weights from their first column on.
#[inline(always)]
fn blocks<'w, 'o, const B: usize, const K: usize>(
    mut weights: &'w [f32],
    stride: usize,
    x: &[[f32; K]],
    out: &'o mut [[f32; K]],
) -> (&'w [f32], &'o mut [[f32; K]]) {
    let (blocks, rest) = out.as_chunks_mut::<B>();
    for block in blocks {
        sum(weights, stride, x, block);
        weights = weights.get(B..).unwrap_or_default();
    }
    (weights, rest)
}

/// The sums of `B` outputs, whose weights start at `weights`.
#[inline(always)]
fn sum<const B: usize, const K: usize>(weights: &[f32], stride: usize, x: &[[f32; K]], out: &mut [[f32; K]; B]) {
    let mut sums = *out;
    let rows = weights.chunks(stride.max(1)).filter_map(<[f32]>::first_chunk::<B>);
    for (x, row) in x.iter().zip(rows) {
        for (sums, weight) in sums.iter_mut().zip(row) {
            for (sum, x) in sums.iter_mut().zip(x) {
                *sum += x * weight;
            }
        }
    }
    *out = sums;
}

/// [`Kernel::sum_rows_columns`].
pub(super) fn sum_rows<const H: usize, const K: usize>(
    kernel: Kernel,
    (layout, weights): (Layout, &[i8]),
    (codes, bits): (&[[i16; H]; K], u32),
    sums: &mut [[i32; H]; K],
    [inputs, outputs]: [usize; 2],
) {
    let groups = weights.chunks(layout.bytes(GROUP, inputs).max(1));
    for (start, group) in (0..outputs).step_by(GROUP).zip(groups) {
        for (codes, sums) in codes.iter().zip(&mut *sums) {
            let rows = sums.get_mut(start..outputs.min(start + GROUP)).unwrap_or_default();
            kernel.sum_rows(layout, group, codes.get(..inputs).unwrap_or_default(), bits, rows);
        }
    }
}
