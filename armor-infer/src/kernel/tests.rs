use super::*;
use armor_core::fixed::{LONG_BITS, MAX_BIAS, MAX_TERMS, SHORT_BITS};
use armor_core::noise::Noise;
use proptest::prelude::*;
use std::io::{Write, stderr};
use std::vec;
use std::vec::Vec;

mod columns;

fn normals(stream: u32, length: usize) -> Vec<f32> {
    let mut values = vec![0.0; length];
    Noise::new(11).fill_normal(stream, 0, &mut values);
    values
}

fn bits_of(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

fn naive(weights: &[f32], x: &[f32], out: &mut [f32]) {
    for o in 0..out.len() {
        for i in 0..x.len() {
            out[o] += x[i] * weights[i * out.len() + o];
        }
    }
}

/// An integer, and often one at the end of its range.
fn extreme(low: i32, high: i32) -> impl Strategy<Value = i32> {
    prop_oneof![2 => low..=high, 1 => Just(low), 1 => Just(high), 1 => Just(low.max(-1).min(high))]
}

/// The weights of rows, codes for them, and the codes' bits.
fn rows() -> impl Strategy<Value = (Vec<i8>, Vec<i16>, u32, usize)> {
    let sizes = (prop_oneof![1usize..80, Just(256), Just(MAX_TERMS)], 0usize..20);
    (sizes, prop_oneof![Just(SHORT_BITS), Just(LONG_BITS)]).prop_flat_map(|((inputs, outputs), bits)| {
        let highest = (1 << bits) - 1;
        let lowest = if bits == LONG_BITS { -highest } else { 0 };
        let weights = proptest::collection::vec(extreme(-128, 127).prop_map(|w| w as i8), inputs * outputs);
        let codes = proptest::collection::vec(extreme(lowest, highest).prop_map(|c| c as i16), inputs);
        (weights, codes, Just(bits), Just(outputs))
    })
}

proptest! {
    #[test]
    fn single_precision_sums_have_the_bits_of_the_plain_loop(
        inputs in 0usize..90,
        outputs in prop_oneof![4 => 0usize..150, 1 => 250usize..300, 1 => 500usize..540],
    ) {
        let (weights, x, start) = (normals(0, inputs * outputs), normals(1, inputs), normals(2, outputs));
        let mut expected = start.clone();
        naive(&weights, &x, &mut expected);
        for kernel in Kernel::available() {
            let mut actual = start.clone();
            kernel.accumulate(&weights, &x, &mut actual);
            prop_assert_eq!(bits_of(&actual), bits_of(&expected), "{}", kernel.name());
        }
    }

    #[test]
    fn sums_without_a_row_of_weights_stay_as_they_are(inputs in 1usize..80, rows in 0usize..9, more in 0usize..9) {
        let weights: Vec<i8> = (0..inputs * rows).map(|i| i as i8).collect();
        let codes: Vec<i16> = (0..inputs).map(|i| i as i16).collect();
        for kernel in Kernel::available() {
            let (mut sums, mut expected) = (vec![-7; rows + more], vec![-7; rows + more]);
            integer::sum_rows(&weights, &codes, &mut expected);
            kernel.sum_rows(Layout::Rows, &weights, &codes, SHORT_BITS, &mut sums);
            prop_assert_eq!(&sums, &expected, "{}", kernel.name());
        }
    }

    #[test]
    fn single_precision_mish_is_the_shared_one(words in proptest::collection::vec(any::<u32>(), 0..70)) {
        // One quiet NaN is another's equal; none has a code or an action.
        let values: Vec<f32> = words.into_iter().map(f32::from_bits).filter(|value| !value.is_nan()).collect();
        let expected: Vec<f32> = values.iter().map(|value| armor_core::mish::mish(*value)).collect();
        for kernel in Kernel::available() {
            let mut actual = values.clone();
            kernel.mish(&mut actual);
            prop_assert_eq!(bits_of(&actual), bits_of(&expected), "{}", kernel.name());
        }
    }

    #[test]
    fn integer_sums_are_exact((weights, codes, bits, outputs) in rows(), without in 0usize..9) {
        let sum = |row: &[i8]| row.iter().zip(&codes).map(|(w, c)| i64::from(*w) * i64::from(*c)).sum::<i64>();
        let kept = std::iter::repeat_n(-1, without);
        let expected: Vec<i64> = weights.chunks_exact(codes.len()).map(sum).chain(kept).collect();
        for kernel in Kernel::available() {
            let mut sums = vec![-1; outputs + without];
            kernel.sum_rows(Layout::Rows, &weights, &codes, bits, &mut sums);
            let sums: Vec<i64> = sums.into_iter().map(i64::from).collect();
            prop_assert_eq!(&sums, &expected, "{}", kernel.name());
        }
    }

    #[test]
    fn the_order_of_the_weights_does_not_show_in_a_sum((weights, codes, bits, outputs) in rows()) {
        let mut paired = vec![0; Layout::Paired.bytes(outputs, codes.len())];
        Layout::Paired.arrange(&weights, codes.len(), &mut paired);
        let mut expected = vec![-1; outputs];
        Kernel::Portable.sum_rows(Layout::Rows, &weights, &codes, bits, &mut expected);
        for kernel in Kernel::available() {
            let mut sums = vec![-1; outputs];
            kernel.sum_rows(Layout::Paired, &paired, &codes, bits, &mut sums);
            prop_assert_eq!(&sums, &expected, "{}", kernel.name());
        }
    }

    #[test]
    fn every_kernel_rescales_alike(
        rows in proptest::collection::vec(
            (extreme(-(1 << 23) + 1, (1 << 23) - 1), extreme(1, i32::MAX), extreme(-MAX_BIAS, MAX_BIAS)), 0..40),
        factor in extreme(1, i32::MAX),
        bits in prop_oneof![Just(SHORT_BITS), Just(LONG_BITS)],
    ) {
        let sums: Vec<i32> = rows.iter().map(|row| row.0 << (bits - SHORT_BITS)).collect();
        let (multiplier, bias): (Vec<i32>, Vec<i32>) = rows.iter().map(|row| (row.1, row.2)).unzip();
        let exact = |(sum, (multiplier, bias)): (&i32, (&i32, &i32))| {
            let round = |a: i64, b: i64| (a * b + (1 << 31)).div_euclid(1 << 32);
            let scaled = round(i64::from(*sum) << (LONG_BITS - bits), (*multiplier).into());
            round(scaled, factor.into()) + i64::from(*bias)
        };
        let expected: Vec<i64> = sums.iter().zip(multiplier.iter().zip(&bias)).map(exact).collect();
        for kernel in Kernel::available() {
            let mut actual = sums.clone();
            kernel.rescale(&mut actual, bits, &multiplier, factor, &bias);
            let actual: Vec<i64> = actual.into_iter().map(i64::from).collect();
            prop_assert_eq!(&actual, &expected, "{}", kernel.name());
        }
    }

    #[test]
    fn every_kernel_activates_alike(
        pre in proptest::collection::vec(prop_oneof![extreme(i32::MIN, i32::MAX), -100_000..100_000], 0..40),
        factor in extreme(1, i32::MAX),
        bits in prop_oneof![Just(SHORT_BITS), Just(LONG_BITS)],
    ) {
        let expected: Vec<i16> = pre.iter().map(|pre| armor_core::fixed::activate(*pre, factor, bits)).collect();
        for kernel in Kernel::available() {
            let mut codes = vec![-1; pre.len()];
            kernel.activate(&pre, factor, bits, &mut codes);
            prop_assert_eq!(&codes, &expected, "{}", kernel.name());
        }
    }
}

/// All pre-activations within the table and beyond both of its ends.
#[test]
fn every_kernel_has_the_same_table() {
    let pre: Vec<i32> = (-(17 << 12)..9 << 12).collect();
    let codes = |kernel: Kernel, bits| {
        let mut codes = vec![0; pre.len()];
        kernel.activate(&pre, 60_000 << (bits - SHORT_BITS), bits, &mut codes);
        codes
    };
    for kernel in Kernel::available() {
        for bits in [SHORT_BITS, LONG_BITS] {
            assert_eq!(codes(kernel, bits), codes(Kernel::Portable, bits), "{}", kernel.name());
        }
    }
}

/// `2^24 + 1` is not an f32, so the place of the large input decides the sum.
#[test]
fn inputs_are_summed_in_their_order_after_the_start_value() {
    const LARGE: f32 = 16_777_216.0;
    for outputs in (1..=80).chain([256, 300]) {
        let weights = vec![1.0; 3 * outputs];
        for kernel in Kernel::available() {
            let sum = |x: [f32; 3], start: f32| {
                let mut out = vec![start; outputs];
                kernel.accumulate(&weights, &x, &mut out);
                out
            };
            assert_eq!(sum([1.0, LARGE, -LARGE], 0.0), vec![0.0; outputs]);
            assert_eq!(sum([LARGE, -LARGE, 1.0], 0.0), vec![1.0; outputs]);
            assert_eq!(sum([LARGE, -LARGE, 0.0], 1.0), vec![0.0; outputs]);
        }
    }
}

/// A fused multiply-add would keep the low part of the square.
#[test]
fn products_are_rounded_before_they_are_added() {
    let x = 1.0 + f32::EPSILON;
    for kernel in Kernel::available() {
        for outputs in [1, 8, 16, 64, 256] {
            let mut out = vec![-(x * x); outputs];
            kernel.accumulate(&vec![x; outputs], &[x], &mut out);
            assert_eq!(out, vec![0.0; outputs], "{}", kernel.name());
        }
    }
}

/// A test of a kernel that this machine lacks would pass unseen; so it is said, past the harness that keeps output.
#[test]
fn the_kernels_that_were_tested_are_named() {
    let tested: Vec<&str> = Kernel::available().map(Kernel::name).collect();
    let known: &[&str] = if cfg!(all(feature = "std", target_arch = "x86_64")) {
        &["portable", "avx2", "avx512", "avx512-vnni"]
    } else {
        &["portable"]
    };
    let missing: Vec<&str> = known.iter().filter(|name| !tested.contains(name)).copied().collect();
    assert_eq!(tested.len() + missing.len(), known.len(), "{tested:?} are not all known");
    let missing = if missing.is_empty() { "none".into() } else { missing.join(", ") };
    writeln!(stderr(), "kernels tested: {}; not tested, for want of instructions: {missing}", tested.join(", "))
        .unwrap();
}

#[test]
fn the_best_kernel_is_one_that_this_machine_has() {
    assert!(Kernel::available().any(|kernel| kernel == Kernel::best()));
    assert_eq!(Kernel::available().next(), Some(Kernel::Portable));
}
