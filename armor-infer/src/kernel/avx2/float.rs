//! Single precision: a lane is another output.

use core::arch::x86_64::*;

use crate::kernel::float;

/// Single-precision numbers in a register.
pub(super) const LANES: usize = 8;
/// Registers of sums, as many as keep the adders busy.
const WIDE: usize = 8;
/// Rows of weights that are fetched ahead: a block reads a part of each row,
/// and the processor does not foresee such steps by itself.
const AHEAD: usize = 8;

#[target_feature(enable = "avx2")]
pub(super) fn accumulate(weights: &[f32], x: &[f32], out: &mut [f32]) {
    let stride = out.len().max(1);
    let (weights, out) = blocks::<WIDE>(weights, stride, x, out);
    let (weights, out) = blocks::<1>(weights, stride, x, out);
    float::accumulate_rest(weights, stride, x, out);
}

/// Works on `out` in blocks of `V` registers; returns the outputs left over,
/// and the weights from their first column on.
///
/// Plain loops would do, but for the compiler: it keeps the sums of more than a
/// few outputs in memory, and loads and stores them for every input.
#[target_feature(enable = "avx2")]
fn blocks<'w, 'o, const V: usize>(
    mut weights: &'w [f32],
    stride: usize,
    x: &[f32],
    out: &'o mut [f32],
) -> (&'w [f32], &'o mut [f32]) {
    let (whole, rest) = out.split_at_mut(out.len() - out.len() % (V * LANES));
    for block in whole.as_chunks_mut::<LANES>().0.as_chunks_mut::<V>().0 {
        let mut sums = [_mm256_setzero_ps(); V];
        for (sum, lanes) in sums.iter_mut().zip(&*block) {
            *sum = load(lanes);
        }
        let rows = weights.chunks(stride).filter_map(|row| row.as_chunks::<LANES>().0.first_chunk::<V>());
        for (x, row) in x.iter().zip(rows) {
            let x = _mm256_set1_ps(*x);
            for (sum, lanes) in sums.iter_mut().zip(row) {
                *sum = _mm256_add_ps(*sum, _mm256_mul_ps(x, load(lanes)));
            }
            for line in row.chunks_exact(2) {
                let ahead = line.as_ptr().cast::<f32>().wrapping_add(AHEAD * stride);
                // SAFETY: a hint, whatever the address; newer compilers ask for no `unsafe`.
                #[allow(unused_unsafe)]
                unsafe {
                    _mm_prefetch::<_MM_HINT_T0>(ahead.cast())
                };
            }
        }
        for (lanes, sum) in block.iter_mut().zip(&sums) {
            // SAFETY: 32 bytes, and no alignment is needed.
            unsafe { _mm256_storeu_ps(lanes.as_mut_ptr(), *sum) };
        }
        weights = weights.get(V * LANES..).unwrap_or_default();
    }
    (weights, rest)
}

#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn load(lanes: &[f32; LANES]) -> __m256 {
    // SAFETY: 32 bytes, and no alignment is needed.
    unsafe { _mm256_loadu_ps(lanes.as_ptr()) }
}

#[target_feature(enable = "avx2")]
pub(super) fn mish(values: &mut [f32]) {
    float::mish(values);
}
