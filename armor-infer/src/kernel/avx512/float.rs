//! Single precision: a lane is another output.

use core::arch::x86_64::*;

use crate::kernel::float;

/// Single-precision numbers in a register.
pub(super) const LANES: usize = 16;
/// Registers of sums: 256 outputs, so that the weights of the usual network are
/// read once, from front to back, as fast as L2 delivers them.
const WIDE: usize = 16;
/// Registers of sums for what is left of the outputs.
const NARROW: usize = 4;

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
pub(super) fn accumulate(weights: &[f32], x: &[f32], out: &mut [f32]) {
    let stride = out.len().max(1);
    let (weights, out) = blocks::<WIDE>(weights, stride, x, out);
    let (weights, out) = blocks::<NARROW>(weights, stride, x, out);
    let (weights, out) = blocks::<1>(weights, stride, x, out);
    float::accumulate_rest(weights, stride, x, out);
}

/// Works on `out` in blocks of `V` registers; returns the outputs left over,
/// and the weights from their first column on.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
fn blocks<'w, 'o, const V: usize>(
    mut weights: &'w [f32],
    stride: usize,
    x: &[f32],
    out: &'o mut [f32],
) -> (&'w [f32], &'o mut [f32]) {
    let (whole, rest) = out.split_at_mut(out.len() - out.len() % (V * LANES));
    for block in whole.as_chunks_mut::<LANES>().0.as_chunks_mut::<V>().0 {
        let mut sums = [_mm512_setzero_ps(); V];
        for (sum, lanes) in sums.iter_mut().zip(&*block) {
            *sum = load(lanes);
        }
        let rows = weights.chunks(stride).filter_map(|row| row.as_chunks::<LANES>().0.first_chunk::<V>());
        for (x, row) in x.iter().zip(rows) {
            let x = _mm512_set1_ps(*x);
            for (sum, lanes) in sums.iter_mut().zip(row) {
                *sum = _mm512_add_ps(*sum, _mm512_mul_ps(x, load(lanes)));
            }
        }
        for (lanes, sum) in block.iter_mut().zip(&sums) {
            // SAFETY: 64 bytes, and no alignment is needed.
            unsafe { _mm512_storeu_ps(lanes.as_mut_ptr(), *sum) };
        }
        weights = weights.get(V * LANES..).unwrap_or_default();
    }
    (weights, rest)
}

#[inline]
#[target_feature(enable = "avx512f")]
pub(super) fn load(lanes: &[f32; LANES]) -> __m512 {
    // SAFETY: 64 bytes, and no alignment is needed.
    unsafe { _mm512_loadu_ps(lanes.as_ptr()) }
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
pub(super) fn mish(values: &mut [f32]) {
    float::mish(values);
}
