//! Fixed point for every machine: the reference of all integer kernels.

use armor_core::fixed;

/// [`Kernel::sum_rows`](super::Kernel::sum_rows).
pub(super) fn sum_rows(weights: &[i8], codes: &[i16], sums: &mut [i32]) {
    for (sum, row) in sums.iter_mut().zip(weights.chunks_exact(codes.len().max(1))) {
        *sum = row.iter().zip(codes).map(|(weight, code)| i32::from(*weight) * i32::from(*code)).sum();
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
