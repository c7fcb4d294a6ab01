//! The Mish activation, `x * tanh(ln(1 + e^x))` (Misra 2019), in one
//! definition for trainer, host and microcontroller.
//!
//! With `e = exp(x)` and `n = e (e + 2)`, `tanh(softplus(x)) = n / (n + 2)`:
//! one exponential, no cancellation, and nothing that keeps a compiler from
//! vectorising the loop around it.

/// `e^x` in f32 for `-87 <= x <= 88`, the same bits on every IEEE-754 machine.
///
/// Below the range it returns 0, above it `e^88`; NaN stays NaN. Within the
/// range the error is below 2 units in the last place. Cody-Waite reduction to
/// `|r| <= ln(2) / 2`, then a polynomial of degree 6; the power of two is
/// rounded by adding `1.5 * 2^23`, which leaves the integer in the low bits of
/// the sum and needs no conversion.
#[inline(always)]
pub fn exp(x: f32) -> f32 {
    let clipped = if x < 88.0 { x } else { 88.0 };
    let value = exp_below(clipped);
    if x.is_nan() { x } else { value }
}

/// [`exp`] of what is no NaN and at most 88.
#[inline(always)]
fn exp_below(x: f32) -> f32 {
    const MAGIC: f32 = 12_582_912.0; // 1.5 * 2^23
    // ln 2 in two parts; the first has 9 trailing zero bits, so its product with n is exact.
    const LN2_HIGH: f32 = 355.0 / 512.0;
    const LN2_LOW: f32 = -2.121_944_4e-4;

    let clipped = if x > -87.0 { x } else { -87.0 };
    let shifted = clipped * core::f32::consts::LOG2_E + MAGIC;
    let n = shifted - MAGIC;
    let r = (clipped - n * LN2_HIGH) - n * LN2_LOW;

    // Minimax coefficients of Cephes `expf` (Moshier): e^r = 1 + r + r^2 p(r).
    let mut p = 1.987_569_1e-4;
    p = p * r + 1.398_2e-3;
    p = p * r + 8.333_452e-3;
    p = p * r + 4.166_579_6e-2;
    p = p * r + 1.666_666_5e-1;
    p = p * r + 0.5;
    let mantissa = (p * r) * r + r + 1.0;

    let power = f32::from_bits(shifted.to_bits().wrapping_add(127) << 23);
    let value = mantissa * power;
    if x < -87.0 { 0.0 } else { value }
}

/// `mish(x)` for finite `x`; NaN stays NaN.
#[inline(always)]
pub fn mish(x: f32) -> f32 {
    let e = exp_below(if x < 20.0 { x } else { 20.0 });
    let n = e * (e + 2.0);
    x * (n / (n + 2.0))
}

/// `mish(x)` and its derivative
/// `n / (n + 2) + 4 x e (e + 1) / (n + 2)^2`, from one exponential.
#[inline(always)]
pub fn mish_with_derivative(x: f32) -> (f32, f32) {
    let e = exp_below(if x < 20.0 { x } else { 20.0 });
    let n = e * (e + 2.0);
    let inverse = 1.0 / (n + 2.0);
    // `n / (n + 2)`, not `n * inverse`: the value has the bits of `mish`.
    let tanh = n / (n + 2.0);
    // e and inverse apart: their squares would overflow near x = 20 in half the range.
    (x * tanh, tanh + x * (4.0 * (e * inverse) * ((e + 1.0) * inverse)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every 1009th float with `low <= |x| <= high`, both signs.
    fn floats(low: f32, high: f32) -> impl Iterator<Item = f32> {
        (low.to_bits()..=high.to_bits()).step_by(1009).flat_map(|bits| [f32::from_bits(bits), -f32::from_bits(bits)])
    }

    fn reference(x: f64) -> f64 {
        x * libm::tanh(libm::log1p(libm::exp(x)))
    }

    #[test]
    fn exp_is_within_two_units_in_the_last_place() {
        for x in floats(1e-30, 87.0) {
            let exact = libm::exp(f64::from(x));
            let ulp = f64::from((exact as f32).next_up()) - f64::from(exact as f32);
            let error = (f64::from(exp(x)) - exact).abs() / ulp;
            assert!(error < 2.0, "exp({x}) is {error} ulp off");
        }
    }

    #[test]
    fn exp_outside_its_range() {
        assert_eq!(exp(-87.001), 0.0);
        assert_eq!(exp(f32::NEG_INFINITY), 0.0);
        assert_eq!(exp(1e30), exp(88.0));
        assert!(exp(f32::NAN).is_nan());
        assert_eq!(exp(0.0), 1.0);
    }

    #[test]
    fn mish_is_within_its_stated_error() {
        for x in floats(1e-20, 80.0) {
            let exact = reference(f64::from(x));
            let error = (f64::from(mish(x)) - exact).abs();
            assert!(error <= 5e-7 * exact.abs(), "mish({x}) is {error:e} off {exact:e}");
        }
        assert_eq!(mish(0.0), 0.0);
        assert!(mish(f32::NAN).is_nan());
        assert_eq!(mish(1e30), 1e30);
        assert_eq!(mish(-1e30), 0.0);
    }

    #[test]
    fn derivative_is_that_of_the_reference() {
        for x in floats(1e-6, 60.0) {
            let (x64, h) = (f64::from(x), 1e-5);
            let slope = (reference(x64 + h) - reference(x64 - h)) / (2.0 * h);
            let (value, derivative) = mish_with_derivative(x);
            assert_eq!(value.to_bits(), mish(x).to_bits());
            assert!((f64::from(derivative) - slope).abs() < 2e-6, "mish'({x}) = {derivative}, not {slope}");
        }
    }
}
