//! Fixed point for every machine: the reference of all integer kernels.

use armor_core::fixed;
use armor_core::image::Layout;

/// [`Kernel::sum_rows`](super::Kernel::sum_rows) of [`Layout::Rows`].
pub(super) fn sum_rows(weights: &[i8], codes: &[i16], sums: &mut [i32]) {
    for (sum, row) in sums.iter_mut().zip(weights.chunks_exact(codes.len().max(1))) {
        *sum = row.iter().zip(codes).map(|(weight, code)| i32::from(*weight) * i32::from(*code)).sum();
    }
}

/// [`Kernel::sum_rows`](super::Kernel::sum_rows) of [`Layout::Paired`].
pub(super) fn sum_pairs(weights: &[i8], codes: &[i16], sums: &mut [i32]) {
    let group = Layout::Paired.bytes(Layout::BLOCK, codes.len()).max(1);
    for (sums, group) in sums.chunks_mut(Layout::BLOCK).zip(weights.chunks_exact(group)) {
        let mut totals = [0; Layout::BLOCK];
        for (codes, block) in codes.chunks(Layout::BLOCK).zip(group.as_chunks().0) {
            add_block(block, codes, &mut totals);
        }
        for (sum, total) in sums.iter_mut().zip(totals) {
            *sum = total;
        }
    }
}

/// Adds the products of a block of [`Layout::Paired`] to the sums of its rows.
#[inline(always)]
pub(super) fn add_block(block: &[i8; Layout::BLOCK * Layout::BLOCK], codes: &[i16], sums: &mut [i32; Layout::BLOCK]) {
    let (pairs, _) = block.as_chunks::<{ 2 * Layout::BLOCK }>();
    for (pair, [low, high]) in pairs.iter().zip(sums.as_chunks_mut().0) {
        for ([low_byte, high_byte], code) in pair.as_chunks().0.iter().zip(codes) {
            let code = i32::from(*code);
            *low += code * i32::from(Layout::Paired.byte(0, *low_byte));
            *high += code * i32::from(*high_byte);
        }
    }
}

/// [`Kernel::rescale`](super::Kernel::rescale).
pub(super) fn rescale(sums: &mut [i32], bits: u32, multiplier: &[i32], rescale: i32, bias: &[i32]) {
    for ((sum, multiplier), bias) in sums.iter_mut().zip(multiplier).zip(bias) {
        *sum = fixed::rescale(*sum, bits, *multiplier, rescale) + bias;
    }
}

/// [`Kernel::activate`](super::Kernel::activate).
pub(super) fn activate(pre: &[i32], factor: i32, bits: u32, codes: &mut [i16]) {
    for (code, pre) in codes.iter_mut().zip(pre) {
        *code = fixed::activate(*pre, factor, bits);
    }
}
