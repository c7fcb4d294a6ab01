//! The fixed-point arithmetic of integer policies. `docs/numerics.md` is the
//! normative text; trainer and controller share the definitions here.
//!
//! Words: a *code* is a small integer that stands for an activation; a
//! *pre-activation* is what a unit's Mish is taken of, an `i32` in steps of
//! `2^-12`; an *activation* is an `i32` in steps of `2^-23`.
//!
//! A code `c` of a layer with scale `s` stands for `s c + LOWEST`: Mish never
//! goes below [`LOWEST`], so codes need no sign, and what the constant adds to
//! a sum is part of its bias.

/// Fractional bits of a pre-activation.
pub const PRE_BITS: u32 = 12;
/// Fractional bits of an activation.
pub const ACTIVATION_BITS: u32 = 23;
/// Bits of the codes of states, embeddings and actions, and of the hidden
/// layers of an `Int16x8` policy; a sum over shorter codes is shifted left by
/// what they lack before it is scaled.
pub const LONG_BITS: u32 = 15;
/// Bits of the codes of the hidden layers of an `Int8` policy. Seven, because
/// two products of them and of an 8-bit weight fit an `i16`.
pub const SHORT_BITS: u32 = 7;
/// What code 0 stands for: a little below Mish's minimum, -0.3088.
pub const LOWEST: f64 = -0.3125;
/// The most products that a sum may have: `512 * 128 * 32767 < 2^31`, so no
/// sum overflows, whatever the weights and the codes are.
pub const MAX_TERMS: usize = 512;
/// The largest magnitude of a bias, in steps of a pre-activation. Every other
/// term of a pre-activation is at most `2^29`, so their sum fits an `i32`.
pub const MAX_BIAS: i32 = 1 << 28;

/// Where the table of Mish begins: `mish(-16) = -1.8e-6`.
pub const TABLE_START: i32 = -(16 << PRE_BITS);
/// Where it ends. From 8 on `mish(z) = z` to within `2e-6` and its entries are
/// 0; it goes on so that a machine can saturate its index to 17 bits (SSAT).
pub const TABLE_END: i32 = 16 << PRE_BITS;
/// Pre-activations from one entry of the table to the next, as a power of two: 1/32.
pub const TABLE_STEP_BITS: u32 = PRE_BITS - 5;
/// The largest pre-activation that is told apart, 128.
pub const PRE_MAX: i32 = (128 << PRE_BITS) - 1;

/// [`LOWEST`] in steps of an activation.
pub const LOWEST_ACTIVATION: i32 = -(5 << (ACTIVATION_BITS - 4));
/// Shift from a pre-activation to an activation.
pub const WIDEN_BITS: u32 = ACTIVATION_BITS - PRE_BITS;

/// `mish(z) - max(z, 0)` at `z = -16, -16 + 1/32, ..., 16`, in steps of `2^-16`.
pub static MISH_RESIDUAL: [i16; TABLE_ENTRIES] = residuals();
const TABLE_ENTRIES: usize = ((TABLE_END - TABLE_START) >> TABLE_STEP_BITS) as usize + 1;

/// `a b / 2^32`, rounded to the nearest integer, halves up. (SMMULR of a Cortex-M4.)
#[inline(always)]
pub const fn mul_round(a: i32, b: i32) -> i32 {
    ((a as i64 * b as i64 + (1 << 31)) >> 32) as i32
}

/// Mish of a pre-activation, less [`LOWEST`]: an activation that is never negative.
///
/// Linear between the entries of [`MISH_RESIDUAL`], without rounding.
#[inline(always)]
pub fn mish_above_lowest(z: i32) -> i32 {
    const FRACTION: i32 = (1 << TABLE_STEP_BITS) - 1;
    let inside = z.clamp(TABLE_START, TABLE_END - 1) - TABLE_START;
    let (index, fraction) = ((inside >> TABLE_STEP_BITS) as usize, inside & FRACTION);
    // The index is below the table's last entry by the clamp.
    let entry = |i: usize| i32::from(MISH_RESIDUAL.get(i).copied().unwrap_or_default());
    let residual = entry(index) * (FRACTION + 1 - fraction) + entry(index + 1) * fraction;
    (z.clamp(0, PRE_MAX) << WIDEN_BITS) + residual - LOWEST_ACTIVATION
}

/// The code of Mish of a pre-activation: `factor` is `2^32` over the
/// activations in a step of the code.
#[inline(always)]
pub fn activate(z: i32, factor: i32, bits: u32) -> i16 {
    mul_round(mish_above_lowest(z), factor).min((1 << bits) - 1) as i16
}

/// A sum over codes of `bits`, as a pre-activation without its bias: per-row
/// `multiplier`, then `rescale` for the scale of the codes.
#[inline(always)]
pub const fn rescale(sum: i32, bits: u32, multiplier: i32, rescale: i32) -> i32 {
    mul_round(mul_round(sum << (LONG_BITS - bits), multiplier), rescale)
}

/// `x factor` rounded to a code of [`LONG_BITS`] and a sign, halves away from zero.
#[inline(always)]
pub fn long_code(x: f32, factor: f32) -> i16 {
    let scaled = x * factor;
    let rounded = scaled + if scaled < 0.0 { -0.5 } else { 0.5 };
    (rounded as i32).clamp(-i32::from(i16::MAX), i16::MAX.into()) as i16
}

const fn residuals() -> [i16; TABLE_ENTRIES] {
    let mut table = [0; TABLE_ENTRIES];
    let mut index = 0;
    while index < TABLE_ENTRIES {
        let z = index as f64 / 32.0 - 16.0;
        // mish(z) = z n / (n + 2), as in `crate::mish`.
        let e = exp(z);
        let n = e * (e + 2.0);
        let residual = if z < 0.0 { z * n / (n + 2.0) } else { -2.0 * z / (n + 2.0) };
        // Never positive, so the cast rounds half a step up to the nearest.
        table[index] = (residual * 65536.0 - 0.5) as i16;
        index += 1;
    }
    table
}

/// `e^x` for `|x| <= 16`, to 14 digits: the series of `x / 64`, squared six times.
const fn exp(x: f64) -> f64 {
    let r = x / 64.0;
    let (mut term, mut sum, mut k) = (1.0, 1.0, 1.0);
    while k < 16.0 {
        term *= r / k;
        sum += term;
        k += 1.0;
    }
    let mut squarings = 0;
    while squarings < 6 {
        sum *= sum;
        squarings += 1;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn mish(x: f64) -> f64 {
        x * libm::tanh(libm::log1p(libm::exp(x)))
    }

    #[test]
    fn every_entry_of_the_table_is_the_nearest_to_the_reference() {
        assert_eq!(MISH_RESIDUAL.len(), 32 * 32 + 1);
        for (index, entry) in (0..).zip(MISH_RESIDUAL) {
            let z = f64::from(index) / 32.0 - 16.0;
            let exact = 65536.0 * (mish(z) - z.max(0.0));
            assert!((f64::from(entry) - exact).abs() <= 0.5, "entry {index} is {entry}, not {exact}");
        }
    }

    /// Every pre-activation from -20 to 129: the error of a chord over 1/32 is
    /// at most `max |mish''| / 8 / 32^2 = 8e-5`, and half a step of the table is 8e-6.
    #[test]
    fn mish_is_within_its_stated_error_at_every_pre_activation() {
        let mut largest = 0.0f64;
        for z in -(20 << PRE_BITS)..=PRE_MAX {
            let exact = mish(f64::from(z) / 4096.0) - LOWEST;
            largest = largest.max((f64::from(mish_above_lowest(z)) / 8_388_608.0 - exact).abs());
        }
        assert!(largest < 9e-5, "{largest:e}");
    }

    /// All codes of both widths, at the smallest, a usual and a large range.
    #[test]
    fn every_code_is_within_half_a_step_and_the_tables_error_of_the_reference() {
        for bits in [SHORT_BITS, LONG_BITS] {
            let highest = f64::from((1 << bits) - 1);
            for range in [0.5, 6.0, 100.0] {
                let factor = highest / (range - LOWEST) * f64::from(1u32 << (32 - ACTIVATION_BITS));
                let factor = libm::round(factor) as i32;
                let step = f64::from(1u32 << (32 - ACTIVATION_BITS)) / f64::from(factor);
                for z in (TABLE_START..PRE_MAX).step_by(7) {
                    let meant = step * f64::from(activate(z, factor, bits)) + LOWEST;
                    let exact = mish(f64::from(z) / 4096.0).min(step * highest + LOWEST);
                    assert!((meant - exact).abs() < 0.5 * step + 9e-5, "{z}: {meant} is not {exact}");
                }
            }
        }
    }

    #[test]
    fn nothing_overflows_at_the_extremes() {
        for z in [i32::MIN, TABLE_START - 1, -1, 0, TABLE_END, PRE_MAX, i32::MAX] {
            assert!(mish_above_lowest(z) >= 0);
            assert!((0..=i16::MAX).contains(&activate(z, i32::MAX, LONG_BITS)));
        }
        let terms = MAX_TERMS as i64;
        assert!(terms * 128 * 32767 <= i64::from(i32::MAX));
        assert!((terms * 128 * 127) << (LONG_BITS - SHORT_BITS) <= i64::from(i32::MAX));
        let largest = i64::from(rescale(i32::MIN, LONG_BITS, i32::MAX, i32::MAX)).abs();
        assert!(largest <= 1 << 29);
        assert!(2 * largest + i64::from(MAX_BIAS) + (1 << 23) + (1 << 28) <= i64::from(i32::MAX));
    }

    #[test]
    fn a_number_that_is_none_has_a_code() {
        assert_eq!(long_code(f32::NAN, 1.0), 0);
        assert_eq!(long_code(f32::INFINITY, 1.0), 32767);
        assert_eq!(long_code(-1e30, 1e30), -32767);
        assert_eq!([0.49, 0.5, -0.5, -0.49].map(|x| long_code(x, 1.0)), [0, 1, -1, 0]);
    }

    proptest! {
        #[test]
        fn mul_round_is_the_rounded_quotient(a in any::<i32>(), b in any::<i32>()) {
            let exact = (i128::from(a) * i128::from(b) * 2 + (1 << 32)).div_euclid(1 << 33);
            prop_assert_eq!(i128::from(mul_round(a, b)), exact);
        }
    }
}
