//! Counter-based noise: what is drawn depends on where it is drawn, never on
//! what was drawn before. The same bits on every machine, for any number of
//! threads, and after any restart.
//!
//! The generator is Philox-4x32-10 (Salmon et al., "Parallel random numbers:
//! as easy as 1, 2, 3", SC 2011); normal draws are by Box and Muller with
//! the bits of `libm` in f32.

use core::f32::consts::TAU;

use crate::turn::sin_cos;

/// A seeded source of noise, addressed by stream, tick and position.
///
/// A stream separates uses (a step of the denoising chain, the choice of a
/// batch), the tick is a time (control step, training step).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Noise {
    key: [u32; 2],
}

/// The largest magnitude a normal draw can have: `sqrt(-2 ln 2^-24)`, rounded up.
pub const MAX_NORMAL: f32 = 5.77;

impl Noise {
    /// The source for a seed.
    pub const fn new(seed: u64) -> Self {
        Self { key: [seed as u32, (seed >> 32) as u32] }
    }

    /// Four independent uniform words at a position.
    pub const fn words(&self, stream: u32, tick: u64, block: u32) -> [u32; 4] {
        philox([block, stream, tick as u32, (tick >> 32) as u32], self.key)
    }

    /// Four independent standard normal draws at a position, each at most [`MAX_NORMAL`] in size.
    pub fn normals(&self, stream: u32, tick: u64, block: u32) -> [f32; 4] {
        let [a, b, c, d] = self.words(stream, tick, block);
        let [w, x] = box_muller(a, b);
        let [y, z] = box_muller(c, d);
        [w, x, y, z]
    }

    /// Fills `out` with the standard normal draws of a stream and tick, from its block 0 on.
    pub fn fill_normal(&self, stream: u32, tick: u64, out: &mut [f32]) {
        for (block, four) in (0..).zip(out.chunks_mut(4)) {
            let [a, b, c, d] = self.words(stream, tick, block);
            // A pair that nobody asks for costs as much as one that somebody does.
            for (two, [a, b]) in four.chunks_mut(2).zip([[a, b], [c, d]]) {
                for (value, draw) in two.iter_mut().zip(box_muller(a, b)) {
                    *value = draw;
                }
            }
        }
    }
}

/// A word as a number in `0 .. n`; the bias is below `n / 2^32`.
pub const fn below(word: u32, n: u32) -> u32 {
    ((word as u64 * n as u64) >> 32) as u32
}

/// A word as a number in `[0, 1)`, in steps of `2^-24`.
pub const fn uniform(word: u32) -> f32 {
    (word >> 8) as f32 / 16_777_216.0
}

/// Two independent standard normal draws from two uniform words.
fn box_muller(a: u32, b: u32) -> [f32; 2] {
    // 1 - u lies in (0, 1], so the logarithm is finite.
    let radius = libm::sqrtf(-2.0 * libm::logf(1.0 - uniform(a)));
    let (sin, cos) = sin_cos(TAU * uniform(b));
    [radius * cos, radius * sin]
}

/// Philox-4x32 with 10 rounds.
const fn philox(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    const MULTIPLIER: [u32; 2] = [0xD251_1F53, 0xCD9E_8D57];
    const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
    let mut round = 0;
    while round < 10 {
        let p0 = MULTIPLIER[0] as u64 * counter[0] as u64;
        let p1 = MULTIPLIER[1] as u64 * counter[2] as u64;
        counter =
            [(p1 >> 32) as u32 ^ counter[1] ^ key[0], p1 as u32, (p0 >> 32) as u32 ^ counter[3] ^ key[1], p0 as u32];
        key = [key[0].wrapping_add(WEYL[0]), key[1].wrapping_add(WEYL[1])];
        round += 1;
    }
    counter
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The known answers that come with Random123 (`tests/kat_vectors`, philox4x32 10).
    #[test]
    fn philox_gives_the_published_bits() {
        let answers = [
            ([0; 4], [0; 2], [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]),
            ([u32::MAX; 4], [u32::MAX; 2], [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]),
            (
                [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344],
                [0xa409_3822, 0x299f_31d0],
                [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1],
            ),
        ];
        for (counter, key, expected) in answers {
            assert_eq!(philox(counter, key), expected);
        }
    }

    #[test]
    fn normal_bits_do_not_change() {
        let bits = Noise::new(7).normals(1, 2, 3).map(f32::to_bits);
        assert_eq!(bits, NORMALS_SEED_7_STREAM_1_TICK_2_BLOCK_3);
    }

    /// Recorded from this function; numpy's float64 Box-Muller on the same words agrees to 4e-7.
    const NORMALS_SEED_7_STREAM_1_TICK_2_BLOCK_3: [u32; 4] =
        [3_215_611_052, 3_212_842_581, 3_203_739_439, 3_214_606_767];

    #[test]
    fn moments_are_those_of_the_standard_normal() {
        let n = 1u32 << 18;
        let draws = || (0..n / 4).flat_map(|block| Noise::new(1).normals(0, 0, block));
        let mean = |f: fn(f64) -> f64| draws().map(|x| f(f64::from(x))).sum::<f64>() / f64::from(n);
        // Five standard errors: sqrt(Var[x^k] / n) with variances 1, 2, 15, 96.
        let tolerance = |variance: f64| 5.0 * libm::sqrt(variance / f64::from(n));
        assert!(mean(|x| x).abs() < tolerance(1.0));
        assert!((mean(|x| x * x) - 1.0).abs() < tolerance(2.0));
        assert!(mean(|x| x * x * x).abs() < tolerance(15.0));
        assert!((mean(|x| x * x * x * x) - 3.0).abs() < tolerance(96.0));
    }

    #[test]
    fn neighbouring_draws_are_uncorrelated() {
        let n = 1u32 << 16;
        let noise = Noise::new(3);
        let product = |a: [f32; 4], b: [f32; 4]| f64::from(a[0] * b[0]);
        let sums = (0..n).fold([0.0; 4], |[w, x, y, z], i| {
            let here = noise.normals(0, u64::from(i), 0);
            [
                w + product(here, noise.normals(0, u64::from(i) + 1, 0)),
                x + product(here, noise.normals(1, u64::from(i), 0)),
                y + product(here, Noise::new(4).normals(0, u64::from(i), 0)),
                z + f64::from(here[0] * here[1]),
            ]
        });
        for sum in sums {
            assert!((sum / f64::from(n)).abs() < 5.0 / libm::sqrt(f64::from(n)), "{sum}");
        }
    }

    #[test]
    fn the_extreme_words_give_finite_draws() {
        for a in [0, 0xff, u32::MAX] {
            for b in [0, u32::MAX] {
                for draw in box_muller(a, b) {
                    assert!(draw.abs() <= MAX_NORMAL);
                }
            }
        }
    }

    #[test]
    fn a_fill_is_its_blocks_one_after_the_other() {
        let noise = Noise::new(9);
        let mut out = [0.0; 6];
        noise.fill_normal(5, 6, &mut out);
        assert_eq!(out[..4], noise.normals(5, 6, 0));
        assert_eq!(out[4..], noise.normals(5, 6, 1)[..2]);
    }

    #[test]
    fn words_map_to_their_ranges() {
        assert_eq!((below(0, 10), below(u32::MAX, 10)), (0, 9));
        assert_eq!(uniform(0), 0.0);
        assert!(uniform(u32::MAX) < 1.0);
    }
}
