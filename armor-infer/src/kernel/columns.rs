//! Single precision for several columns at once, for every machine: the weights
//! are read once for all of them. A compiler vectorises over the columns.

/// Outputs whose sums are taken side by side.
const BLOCK: usize = 4;

/// [`Kernel::accumulate_columns`](super::Kernel::accumulate_columns).
#[inline(always)]
pub(super) fn accumulate<const K: usize>(mut weights: &[f32], x: &[[f32; K]], out: &mut [[f32; K]]) {
    let stride = out.len().max(1);
    let (blocks, rest) = out.as_chunks_mut::<BLOCK>();
    for block in blocks {
        sum(weights, stride, x, block);
        weights = weights.get(BLOCK..).unwrap_or_default();
    }
    for output in rest.as_chunks_mut::<1>().0 {
        sum(weights, stride, x, output);
        weights = weights.get(1..).unwrap_or_default();
    }
}

/// The sums of `B` outputs, whose weights start at `weights`.
#[inline(always)]
fn sum<const B: usize, const K: usize>(weights: &[f32], stride: usize, x: &[[f32; K]], out: &mut [[f32; K]; B]) {
    let mut sums = *out;
    let rows = weights.chunks(stride).filter_map(<[f32]>::first_chunk::<B>);
    for (x, row) in x.iter().zip(rows) {
        for (sums, weight) in sums.iter_mut().zip(row) {
            for (sum, x) in sums.iter_mut().zip(x) {
                *sum += x * weight;
            }
        }
    }
    *out = sums;
}
