//! Single precision for every machine: plain loops that a compiler vectorises.

/// Outputs whose sums are kept in registers while the inputs pass by: eight
/// SSE registers, as many as two additions a cycle of latency four keep busy.
#[cfg(not(target_arch = "arm"))]
const WIDE: usize = 32;
/// Half of the 32 single-precision registers of a Cortex-M FPU.
#[cfg(target_arch = "arm")]
const WIDE: usize = 16;
/// Outputs at a time in what is left of them.
const NARROW: usize = 8;

/// [`Kernel::accumulate`](super::Kernel::accumulate).
#[inline(always)]
pub(super) fn accumulate(weights: &[f32], x: &[f32], out: &mut [f32]) {
    let stride = out.len().max(1);
    let (weights, out) = blocks::<WIDE>(weights, stride, x, out);
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
        let rows = weights.chunks(stride).filter_map(<[f32]>::first_chunk::<B>);
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

#[cfg(test)]
mod tests {
    use super::*;
    use armor_core::noise::Noise;
    use proptest::prelude::*;
    use std::vec;
    use std::vec::Vec;

    fn normals(stream: u32, length: usize) -> Vec<f32> {
        let mut values = vec![0.0; length];
        Noise::new(11).fill_normal(stream, 0, &mut values);
        values
    }

    fn bits(values: &[f32]) -> Vec<u32> {
        values.iter().map(|value| value.to_bits()).collect()
    }

    fn naive(weights: &[f32], x: &[f32], out: &mut [f32]) {
        for o in 0..out.len() {
            for i in 0..x.len() {
                out[o] += x[i] * weights[i * out.len() + o];
            }
        }
    }

    proptest! {
        #[test]
        fn the_bits_are_those_of_the_plain_loop(inputs in 0usize..90, outputs in 0usize..150) {
            let (weights, x, start) = (normals(0, inputs * outputs), normals(1, inputs), normals(2, outputs));
            let (mut expected, mut actual) = (start.clone(), start);
            naive(&weights, &x, &mut expected);
            accumulate(&weights, &x, &mut actual);
            prop_assert_eq!(bits(&actual), bits(&expected));
        }
    }

    /// `2^24 + 1` is not an f32, so the place of the large input decides the sum.
    #[test]
    fn inputs_are_summed_in_their_order_after_the_start_value() {
        const LARGE: f32 = 16_777_216.0;
        for outputs in 1..=WIDE + NARROW + 7 {
            let weights = vec![1.0; 3 * outputs];
            let sum = |x: [f32; 3], start: f32| {
                let mut out = vec![start; outputs];
                accumulate(&weights, &x, &mut out);
                out
            };
            assert_eq!(sum([1.0, LARGE, -LARGE], 0.0), vec![0.0; outputs]);
            assert_eq!(sum([LARGE, -LARGE, 1.0], 0.0), vec![1.0; outputs]);
            assert_eq!(sum([LARGE, -LARGE, 0.0], 1.0), vec![0.0; outputs]);
        }
    }

    /// A fused multiply-add would keep the low part of the square.
    #[test]
    fn products_are_rounded_before_they_are_added() {
        let x = 1.0 + f32::EPSILON;
        let mut out = [-(x * x)];
        accumulate(&[x], &[x], &mut out);
        assert_eq!(out, [0.0]);
    }
}
