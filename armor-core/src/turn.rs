//! Sine and cosine of an angle within one turn.
//!
//! With the bits of `libm::sincosf`, which is musl's (from FreeBSD's msun,
//! `k_sinf.c` and `k_cosf.c`: polynomials in f64 on a quarter turn). Its
//! reduction of large angles, which no noise needs, takes 640 bytes of stack
//! and 3 KB of flash: much, where a controller has 2 KB and 64 KB.

use core::f64::consts::FRAC_PI_2;

/// The largest angles that count from one axis, an eighth of a turn beyond it.
const EIGHTHS: [f32; 4] = [
    f32::from_bits(0x3F49_0FDA),
    f32::from_bits(0x4016_CBE3),
    f32::from_bits(0x407B_53D1),
    f32::from_bits(0x40AF_EDDF),
];

/// Sine and cosine of `angle`, from 0 to 2 pi.
pub(crate) fn sin_cos(angle: f32) -> (f32, f32) {
    let x = f64::from(angle);
    let quarters = EIGHTHS.iter().filter(|&&largest| angle > largest).count() as u8;
    let rest = x - f64::from(quarters) * FRAC_PI_2;
    let (sin, cos) = (sine(rest), cosine(rest));
    match quarters {
        0 | 4 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

fn sine(x: f64) -> f32 {
    const S: [f64; 4] =
        [-0.166_666_666_416_265_24, 0.008_333_329_385_889_463, -0.000_198_393_348_360_966_32, 2.718_311_493_989_822e-6];
    let square = x * x;
    let cube = square * x;
    let high = S[2] + square * S[3];
    ((x + cube * (S[0] + square * S[1])) + cube * (square * square) * high) as f32
}

fn cosine(x: f64) -> f32 {
    const C: [f64; 4] =
        [-0.499_999_997_251_031, 0.041_666_623_323_739_06, -0.001_388_676_377_460_993, 2.439_044_879_627_741_4e-5];
    let square = x * x;
    let fourth = square * square;
    let high = C[2] + square * C[3];
    (((1.0 + square * C[0]) + fourth * C[1]) + (fourth * square) * high) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::uniform;

    /// Every angle that noise can ask for.
    #[test]
    fn all_bits_are_those_of_libm() {
        for word in 0..1u32 << 24 {
            let angle = core::f32::consts::TAU * uniform(word << 8);
            let (sin, cos) = sin_cos(angle);
            let (expected_sin, expected_cos) = libm::sincosf(angle);
            assert_eq!((sin.to_bits(), cos.to_bits()), (expected_sin.to_bits(), expected_cos.to_bits()), "{angle:e}");
        }
    }
}
