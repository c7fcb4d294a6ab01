//! Fixed point: sums are exact in any order, and every rounding is the contract's.

use core::arch::x86_64::*;

use armor_core::fixed::{
    LONG_BITS, LOWEST_ACTIVATION, MAX_TERMS, MISH_RESIDUAL, PRE_MAX, TABLE_END, TABLE_START, TABLE_STEP_BITS,
    WIDEN_BITS,
};

use crate::denoiser::front;
use crate::kernel::integer;

/// Rows whose sums are taken side by side.
const ROWS: usize = 4;

/// Codes of 7 bits, 32 at a time: two products fit 16 bits, so VPMADDUBSW never saturates.
#[target_feature(enable = "avx2")]
pub(super) fn sum_rows_short(weights: &[i8], codes: &[i16], sums: &mut [i32]) {
    let mut bytes = [0; MAX_TERMS];
    let Some(bytes) = bytes.get_mut(..codes.len()) else { return integer::sum_rows(weights, codes, sums) };
    for (byte, code) in bytes.iter_mut().zip(codes) {
        *byte = *code as u8;
    }
    let (chunks, _) = bytes.as_chunks::<32>();
    let add = |sum, weights: &[i8; 32], codes: &[u8; 32]| {
        // SAFETY: both are 32 bytes, and need no alignment.
        let (weights, codes) =
            unsafe { (_mm256_loadu_si256(weights.as_ptr().cast()), _mm256_loadu_si256(codes.as_ptr().cast())) };
        let pairs = _mm256_maddubs_epi16(codes, weights);
        _mm256_add_epi32(sum, _mm256_madd_epi16(pairs, _mm256_set1_epi16(1)))
    };
    sum_in_chunks(weights, codes, sums, chunks, add);
}

/// Codes of 15 bits and a sign, 16 at a time.
#[target_feature(enable = "avx2")]
pub(super) fn sum_rows_long(weights: &[i8], codes: &[i16], sums: &mut [i32]) {
    let (chunks, _) = codes.as_chunks::<16>();
    let add = |sum, weights: &[i8; 16], codes: &[i16; 16]| {
        // SAFETY: 16 and 32 bytes, and neither needs an alignment.
        let (weights, codes) =
            unsafe { (_mm_loadu_si128(weights.as_ptr().cast()), _mm256_loadu_si256(codes.as_ptr().cast())) };
        _mm256_add_epi32(sum, _mm256_madd_epi16(_mm256_cvtepi8_epi16(weights), codes))
    };
    sum_in_chunks(weights, codes, sums, chunks, add);
}

/// Sums rows by `add`, which adds a chunk's products to eight partial sums;
/// `chunks` are the codes' whole chunks, and plain loops do the rest.
#[target_feature(enable = "avx2")]
fn sum_in_chunks<T, const N: usize>(
    weights: &[i8],
    codes: &[i16],
    sums: &mut [i32],
    chunks: &[[T; N]],
    add: impl Fn(__m256i, &[i8; N], &[T; N]) -> __m256i,
) {
    let stride = codes.len().max(1);
    // Sums beyond the weights must not take a block from rows that have some.
    let sums = front(sums, (weights.len() / stride).min(sums.len()));
    let tail = codes.get(chunks.len() * N..).unwrap_or_default();
    let (blocks, rest) = sums.as_chunks_mut::<ROWS>();
    let mut groups = weights.chunks_exact(ROWS * stride);
    for (block, group) in blocks.iter_mut().zip(&mut groups) {
        let mut rows = group.chunks_exact(stride).map(|row| row.as_chunks::<N>());
        let [a, b, c, d]: [_; ROWS] = core::array::from_fn(|_| rows.next().unwrap_or_default());
        let [mut sum_a, mut sum_b, mut sum_c, mut sum_d] = [_mm256_setzero_si256(); ROWS];
        for ((((codes, a), b), c), d) in chunks.iter().zip(a.0).zip(b.0).zip(c.0).zip(d.0) {
            sum_a = add(sum_a, a, codes);
            sum_b = add(sum_b, b, codes);
            sum_c = add(sum_c, c, codes);
            sum_d = add(sum_d, d, codes);
        }
        let pairs = _mm256_hadd_epi32(_mm256_hadd_epi32(sum_a, sum_b), _mm256_hadd_epi32(sum_c, sum_d));
        let total = _mm_add_epi32(_mm256_castsi256_si128(pairs), _mm256_extracti128_si256::<1>(pairs));
        // SAFETY: a block is 16 bytes, and needs no alignment.
        unsafe { _mm_storeu_si128(block.as_mut_ptr().cast(), total) };
        for (sum, (_, weights)) in block.iter_mut().zip([a, b, c, d]) {
            *sum += weights.iter().zip(tail).map(|(weight, code)| i32::from(*weight) * i32::from(*code)).sum::<i32>();
        }
    }
    integer::sum_rows(weights.get(blocks.len() * ROWS * stride..).unwrap_or_default(), codes, rest);
}

/// [`armor_core::fixed::mul_round`] of eight pairs.
#[target_feature(enable = "avx2")]
fn mul_round(a: __m256i, b: __m256i) -> __m256i {
    let half = _mm256_set1_epi64x(1 << 31);
    let even = _mm256_add_epi64(_mm256_mul_epi32(a, b), half);
    let (a, b) = (_mm256_srli_epi64::<32>(a), _mm256_srli_epi64::<32>(b));
    let odd = _mm256_add_epi64(_mm256_mul_epi32(a, b), half);
    _mm256_blend_epi32::<0b1010_1010>(_mm256_srli_epi64::<32>(even), odd)
}

#[target_feature(enable = "avx2")]
pub(super) fn rescale(sums: &mut [i32], bits: u32, multiplier: &[i32], factor: i32, bias: &[i32]) {
    let align = _mm_cvtsi32_si128((LONG_BITS - bits) as i32);
    let (blocks, rest) = sums.as_chunks_mut::<8>();
    let done = 8 * blocks.len();
    let rows = multiplier.as_chunks::<8>().0.iter().zip(bias.as_chunks::<8>().0);
    for (block, (multiplier, bias)) in blocks.iter_mut().zip(rows) {
        // SAFETY: all three are 32 bytes, and need no alignment.
        unsafe {
            let sum = _mm256_sll_epi32(_mm256_loadu_si256(block.as_ptr().cast()), align);
            let scaled = mul_round(sum, _mm256_loadu_si256(multiplier.as_ptr().cast()));
            let pre = mul_round(scaled, _mm256_set1_epi32(factor));
            let pre = _mm256_add_epi32(pre, _mm256_loadu_si256(bias.as_ptr().cast()));
            _mm256_storeu_si256(block.as_mut_ptr().cast(), pre);
        }
    }
    let (multiplier, bias) = (multiplier.get(done..).unwrap_or_default(), bias.get(done..).unwrap_or_default());
    integer::rescale(rest, bits, multiplier, factor, bias);
}

#[target_feature(enable = "avx2")]
pub(super) fn activate(pre: &[i32], factor: i32, bits: u32, codes: &mut [i16]) {
    let (blocks, rest) = codes.as_chunks_mut::<8>();
    let (whole, pre_rest) = pre.as_chunks::<8>();
    for (block, pre) in blocks.iter_mut().zip(whole) {
        // SAFETY: 32 bytes, and no alignment is needed.
        let pre = unsafe { _mm256_loadu_si256(pre.as_ptr().cast()) };
        let code = mul_round(mish_above_lowest(pre), _mm256_set1_epi32(factor));
        let code = _mm256_min_epi32(code, _mm256_set1_epi32((1 << bits) - 1));
        let packed = _mm256_permute4x64_epi64::<0b1000>(_mm256_packs_epi32(code, code));
        // SAFETY: a block is 16 bytes, and needs no alignment.
        unsafe { _mm_storeu_si128(block.as_mut_ptr().cast(), _mm256_castsi256_si128(packed)) };
    }
    integer::activate(pre_rest, factor, bits, rest);
}

/// [`armor_core::fixed::mish_above_lowest`] of eight pre-activations.
#[target_feature(enable = "avx2")]
fn mish_above_lowest(z: __m256i) -> __m256i {
    const STEP: i32 = 1 << TABLE_STEP_BITS;
    let set = |value| _mm256_set1_epi32(value);
    let clamp = |low, high| _mm256_min_epi32(_mm256_max_epi32(z, set(low)), set(high));
    let inside = _mm256_sub_epi32(clamp(TABLE_START, TABLE_END - 1), set(TABLE_START));
    let index = _mm256_srli_epi32::<{ TABLE_STEP_BITS as i32 }>(inside);
    let fraction = _mm256_and_si256(inside, set(STEP - 1));
    // SAFETY: an index is below the table's last entry, and what is read is
    // that entry and the next, without alignment.
    let entries = unsafe { _mm256_i32gather_epi32::<2>(MISH_RESIDUAL.as_ptr().cast(), index) };
    // The weights of the two entries: the lower half STEP - fraction, the upper half fraction.
    let upper = _mm256_sub_epi32(_mm256_slli_epi32::<16>(fraction), fraction);
    let residual = _mm256_madd_epi16(entries, _mm256_add_epi32(upper, set(STEP)));
    let linear = _mm256_slli_epi32::<{ WIDEN_BITS as i32 }>(clamp(0, PRE_MAX));
    _mm256_add_epi32(_mm256_add_epi32(linear, residual), set(-LOWEST_ACTIVATION))
}
