//! Fixed point: sums are exact in any order, and every rounding is the contract's.

use core::arch::x86_64::*;

use armor_core::fixed::{
    LONG_BITS, LOWEST_ACTIVATION, MAX_TERMS, MISH_RESIDUAL, PRE_MAX, TABLE_END, TABLE_START, TABLE_STEP_BITS,
    WIDEN_BITS,
};

use crate::denoiser::front;
use crate::kernel::integer;

/// Integers of 32 bits in a register.
const LANES: usize = 16;
/// Rows whose sums are taken side by side.
const ROWS: usize = 8;

/// Codes of 7 bits, 64 at a time.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx512vnni")]
pub(super) fn sum_rows_short(weights: &[i8], codes: &[i16], sums: &mut [i32]) {
    let mut bytes = [0; MAX_TERMS];
    let Some(front) = bytes.get_mut(..codes.len()) else { return integer::sum_rows(weights, codes, sums) };
    for (byte, code) in front.iter_mut().zip(codes) {
        *byte = *code as u8;
    }
    let add = |sum, codes: &[u8; 64], weights: *const i8, mask| {
        // SAFETY: the weights of the mask are readable, and the codes are 64 bytes; neither needs an alignment.
        let (weights, codes) =
            unsafe { (_mm512_maskz_loadu_epi8(mask, weights), _mm512_loadu_si512(codes.as_ptr().cast())) };
        _mm512_dpbusd_epi32(sum, codes, weights)
    };
    sum_in_chunks(weights, codes.len(), bytes.as_chunks().0, sums, add);
}

/// Codes of 15 bits and a sign, 32 at a time.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx512vnni")]
pub(super) fn sum_rows_long(weights: &[i8], codes: &[i16], sums: &mut [i32]) {
    let mut words = [0; MAX_TERMS];
    let Some(front) = words.get_mut(..codes.len()) else { return integer::sum_rows(weights, codes, sums) };
    front.copy_from_slice(codes);
    let add = |sum, codes: &[i16; 32], weights: *const i8, mask| {
        // SAFETY: as above.
        let (weights, codes) =
            unsafe { (_mm256_maskz_loadu_epi8(mask as u32, weights), _mm512_loadu_si512(codes.as_ptr().cast())) };
        _mm512_dpwssd_epi32(sum, _mm512_cvtepi8_epi16(weights), codes)
    };
    sum_in_chunks(weights, codes.len(), words.as_chunks().0, sums, add);
}

/// Sums rows of `stride` weights by `add`, which adds a chunk's products to
/// sixteen partial sums, for as many weights as its mask has ones; codes beyond
/// `stride` are zero.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx512vnni")]
fn sum_in_chunks<T, const N: usize>(
    weights: &[i8],
    stride: usize,
    codes: &[[T; N]],
    sums: &mut [i32],
    add: impl Fn(__m512i, &[T; N], *const i8, u64) -> __m512i,
) {
    let stride = stride.max(1);
    // Sums beyond the weights must not take a block from rows that have some.
    let sums = front(sums, (weights.len() / stride).min(sums.len()));
    let (blocks, rest) = sums.as_chunks_mut::<ROWS>();
    let groups = weights.chunks_exact(ROWS * stride);
    for (block, group) in blocks.iter_mut().zip(groups) {
        let total = total(partial_sums(group, stride, codes, &add));
        // SAFETY: a block is 32 bytes, and needs no alignment.
        unsafe { _mm256_storeu_si256(block.as_mut_ptr().cast(), total) };
    }
    let rows = weights.get(blocks.len() * ROWS * stride..).unwrap_or_default().chunks_exact(stride);
    for (sum, row) in rest.iter_mut().zip(rows) {
        let [partial] = partial_sums(row, stride, codes, &add);
        *sum = _mm512_reduce_add_epi32(partial);
    }
}

/// Sixteen partial sums for each of the `R` rows of `group`.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx512vnni")]
fn partial_sums<T, const N: usize, const R: usize>(
    group: &[i8],
    stride: usize,
    codes: &[[T; N]],
    add: &impl Fn(__m512i, &[T; N], *const i8, u64) -> __m512i,
) -> [__m512i; R] {
    let mut sums = [_mm512_setzero_si512(); R];
    let (whole, rest) = codes.split_at(codes.len().min(stride / N));
    let mut add_chunk = |start, codes, mask| {
        for (row, sum) in sums.iter_mut().enumerate() {
            *sum = add(*sum, codes, group.as_ptr().wrapping_add(row * stride + start), mask);
        }
    };
    for (start, codes) in (0..).step_by(N).zip(whole) {
        add_chunk(start, codes, u64::MAX);
    }
    if let (Some(codes), tail @ 1..) = (rest.first(), stride % N) {
        add_chunk(stride - tail, codes, (1 << tail) - 1);
    }
    sums
}

/// The totals of eight times sixteen partial sums.
#[target_feature(enable = "avx512f")]
fn total([a, b, c, d, e, f, g, h]: [__m512i; ROWS]) -> __m256i {
    let pair = |a, b| _mm512_add_epi32(_mm512_unpacklo_epi32(a, b), _mm512_unpackhi_epi32(a, b));
    let four = |ab, cd| _mm512_add_epi32(_mm512_unpacklo_epi64(ab, cd), _mm512_unpackhi_epi64(ab, cd));
    let (abcd, efgh) = (four(pair(a, b), pair(c, d)), four(pair(e, f), pair(g, h)));
    // Each quarter of a register holds a quarter of four sums.
    let low = _mm512_shuffle_i32x4::<0b10_00_10_00>(abcd, efgh);
    let halves = _mm512_add_epi32(low, _mm512_shuffle_i32x4::<0b11_01_11_01>(abcd, efgh));
    let (low, high) =
        (_mm512_shuffle_i32x4::<0b10_00>(halves, halves), _mm512_shuffle_i32x4::<0b11_01>(halves, halves));
    _mm512_castsi512_si256(_mm512_add_epi32(low, high))
}

/// [`armor_core::fixed::mul_round`] of sixteen pairs.
#[target_feature(enable = "avx512f")]
fn mul_round(a: __m512i, b: __m512i) -> __m512i {
    let half = _mm512_set1_epi64(1 << 31);
    let even = _mm512_add_epi64(_mm512_mul_epi32(a, b), half);
    let (a, b) = (_mm512_srli_epi64::<32>(a), _mm512_srli_epi64::<32>(b));
    let odd = _mm512_add_epi64(_mm512_mul_epi32(a, b), half);
    _mm512_mask_blend_epi32(0b1010_1010_1010_1010, _mm512_srli_epi64::<32>(even), odd)
}

#[target_feature(enable = "avx512f")]
pub(super) fn rescale(sums: &mut [i32], bits: u32, multiplier: &[i32], factor: i32, bias: &[i32]) {
    let align = _mm_cvtsi32_si128((LONG_BITS - bits) as i32);
    let (blocks, rest) = sums.as_chunks_mut::<LANES>();
    let done = LANES * blocks.len();
    let rows = multiplier.as_chunks::<LANES>().0.iter().zip(bias.as_chunks::<LANES>().0);
    for (block, (multiplier, bias)) in blocks.iter_mut().zip(rows) {
        // SAFETY: all three are 64 bytes, and need no alignment.
        unsafe {
            let sum = _mm512_sll_epi32(_mm512_loadu_si512(block.as_ptr().cast()), align);
            let scaled = mul_round(sum, _mm512_loadu_si512(multiplier.as_ptr().cast()));
            let pre = mul_round(scaled, _mm512_set1_epi32(factor));
            let pre = _mm512_add_epi32(pre, _mm512_loadu_si512(bias.as_ptr().cast()));
            _mm512_storeu_si512(block.as_mut_ptr().cast(), pre);
        }
    }
    let (multiplier, bias) = (multiplier.get(done..).unwrap_or_default(), bias.get(done..).unwrap_or_default());
    integer::rescale(rest, bits, multiplier, factor, bias);
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
pub(super) fn activate(pre: &[i32], factor: i32, bits: u32, codes: &mut [i16]) {
    let (blocks, rest) = codes.as_chunks_mut::<LANES>();
    let (whole, pre_rest) = pre.as_chunks::<LANES>();
    for (block, pre) in blocks.iter_mut().zip(whole) {
        // SAFETY: 64 bytes, and no alignment is needed.
        let pre = unsafe { _mm512_loadu_si512(pre.as_ptr().cast()) };
        let code = mul_round(mish_above_lowest(pre), _mm512_set1_epi32(factor));
        let code = _mm512_min_epi32(code, _mm512_set1_epi32((1 << bits) - 1));
        // SAFETY: a block is 32 bytes, and needs no alignment.
        unsafe { _mm256_storeu_si256(block.as_mut_ptr().cast(), _mm512_cvtepi32_epi16(code)) };
    }
    integer::activate(pre_rest, factor, bits, rest);
}

/// [`armor_core::fixed::mish_above_lowest`] of sixteen pre-activations.
#[target_feature(enable = "avx512f,avx512bw")]
fn mish_above_lowest(z: __m512i) -> __m512i {
    const STEP: i32 = 1 << TABLE_STEP_BITS;
    let set = |value| _mm512_set1_epi32(value);
    let clamp = |low, high| _mm512_min_epi32(_mm512_max_epi32(z, set(low)), set(high));
    let inside = _mm512_sub_epi32(clamp(TABLE_START, TABLE_END - 1), set(TABLE_START));
    let index = _mm512_srli_epi32::<TABLE_STEP_BITS>(inside);
    let fraction = _mm512_and_si512(inside, set(STEP - 1));
    // SAFETY: an index is below the table's last entry, and what is read is
    // that entry and the next, without alignment.
    let entries = unsafe { _mm512_i32gather_epi32::<2>(index, MISH_RESIDUAL.as_ptr().cast()) };
    // The weights of the two entries: the lower half STEP - fraction, the upper half fraction.
    let upper = _mm512_sub_epi32(_mm512_slli_epi32::<16>(fraction), fraction);
    let residual = _mm512_madd_epi16(entries, _mm512_add_epi32(upper, set(STEP)));
    let linear = _mm512_slli_epi32::<WIDEN_BITS>(clamp(0, PRE_MAX));
    _mm512_add_epi32(_mm512_add_epi32(linear, residual), set(-LOWEST_ACTIVATION))
}
