//! Single precision for every machine: plain loops that a compiler vectorises.

/// Outputs at a time in what is left of them.
const NARROW: usize = 8;

/// [`Kernel::accumulate`](super::Kernel::accumulate), `WIDE` outputs at a time.
#[inline(always)]
pub(super) fn accumulate<const WIDE: usize>(weights: &[f32], x: &[f32], out: &mut [f32]) {
    let stride = out.len().max(1);
    let (weights, out) = blocks::<WIDE>(weights, stride, x, out);
    accumulate_rest(weights, stride, x, out);
}

/// [`accumulate`] of the last outputs of a matrix that has `stride` of them;
/// `weights` starts at their first column.
#[inline(always)]
pub(super) fn accumulate_rest(weights: &[f32], stride: usize, x: &[f32], out: &mut [f32]) {
    let (weights, out) = blocks::<NARROW>(weights, stride, x, out);
    // The output layer is a few sums over many inputs: its time is the latency
    // of one sum, so all that is left is summed in a single pass.
    match out.len() {
        1 => blocks::<1>(weights, stride, x, out),
        2 => blocks::<2>(weights, stride, x, out),
        3 => blocks::<3>(weights, stride, x, out),
        4 => blocks::<4>(weights, stride, x, out),
        5 => blocks::<5>(weights, stride, x, out),
        6 => blocks::<6>(weights, stride, x, out),
        7 => blocks::<7>(weights, stride, x, out),
        _ => (weights, out),
    };
}

/// [`Kernel::mish`](super::Kernel::mish).
#[inline(always)]
pub(super) fn mish(values: &mut [f32]) {
    for value in values {
        *value = armor_core::mish::mish(*value);
    }
}

/// Works on `out` in blocks of `B` outputs; returns the outputs left over, and
/// the weights from their first column on.
#[inline(always)]
fn blocks<'w, 'o, const B: usize>(
    mut weights: &'w [f32],
    stride: usize,
    x: &[f32],
    out: &'o mut [f32],
) -> (&'w [f32], &'o mut [f32]) {
    let (blocks, rest) = out.as_chunks_mut::<B>();
    for block in blocks {
        let mut sums = *block;
        // It is at least 1; `max` tells the compiler, which else keeps a panic.
        let rows = weights.chunks(stride.max(1)).filter_map(<[f32]>::first_chunk::<B>);
        for (x, row) in x.iter().zip(rows) {
            for (sum, weight) in sums.iter_mut().zip(row) {
                *sum += x * weight;
            }
        }
        *block = sums;
        weights = weights.get(B..).unwrap_or_default();
    }
    (weights, rest)
}
