//! A kernel against the portable one, on the machine itself.

use armor_core::fixed::{LONG_BITS, MAX_BIAS, SHORT_BITS};
use armor_core::image::Layout;
use armor_core::noise::{Noise, below};

use super::Kernel;

/// The largest matrix of a round; the largest are drawn as well as the smallest.
const ROWS: usize = 9;
const COLUMNS: usize = 76;
/// Outputs and inputs of the largest matrix in single precision.
const OUTPUTS: usize = 37;
const INPUTS: usize = 9;

/// Room for a paired matrix of that size.
const BYTES: usize = Layout::Paired.bytes(ROWS, COLUMNS);

/// Numbers that start on a word, as those of an image do.
#[repr(align(4))]
struct OnWords<T>(T);

impl Kernel {
    /// Compares this kernel with [`Kernel::Portable`], on random sizes and on
    /// numbers that are random or extreme: `rounds` rounds of each operation.
    /// Firmware may do so at its start, in 2 KiB of stack.
    ///
    /// # Errors
    /// The name of an operation whose bits differ: the kernel must not fly on this machine.
    pub fn check(self, seed: u64, rounds: u32) -> Result<(), &'static str> {
        for round in 0..rounds {
            let draw = Draw { noise: Noise::new(seed), round };
            let bits = if draw.word(0, 0).is_multiple_of(2) { SHORT_BITS } else { LONG_BITS };
            for (name, agrees) in [
                ("accumulate", self.accumulates_alike(draw)),
                ("mish", self.mish_is_alike(draw)),
                ("sum_rows in rows", self.sums_alike(draw, Layout::Rows, bits)),
                ("sum_rows in pairs", self.sums_alike(draw, Layout::Paired, bits)),
                ("rescale", self.rescales_alike(draw, bits)),
                ("activate", self.activates_alike(draw, bits)),
            ] {
                if !agrees {
                    return Err(name);
                }
            }
        }
        Ok(())
    }

    fn accumulates_alike(self, draw: Draw) -> bool {
        let (inputs, outputs) = (draw.size(1, INPUTS), draw.size(2, OUTPUTS));
        let (mut weights, mut x) = ([0.0; INPUTS * OUTPUTS], [0.0; INPUTS]);
        draw.floats(3, &mut weights);
        draw.floats(4, &mut x);
        let weights = weights.get(..inputs * outputs).unwrap_or_default();
        let sums = |kernel: Self| {
            let mut out = [0.0; OUTPUTS];
            draw.floats(5, &mut out);
            kernel.accumulate(weights, x.get(..inputs).unwrap_or_default(), out.get_mut(..outputs).unwrap_or_default());
            out.map(f32::to_bits)
        };
        sums(self) == sums(Self::Portable)
    }

    fn mish_is_alike(self, draw: Draw) -> bool {
        let values = |kernel: Self| {
            let mut values = [0.0; OUTPUTS];
            draw.floats(6, &mut values);
            kernel.mish(&mut values);
            values.map(f32::to_bits)
        };
        values(self) == values(Self::Portable)
    }

    fn sums_alike(self, draw: Draw, layout: Layout, bits: u32) -> bool {
        let (rows, columns) = (draw.size(7, ROWS), draw.size(8, COLUMNS));
        let (mut weights, mut codes) = (OnWords([0; BYTES]), OnWords([0; COLUMNS]));
        for (at, weight) in (0..).zip(&mut weights.0) {
            *weight = draw.integer(9, at, i8::MIN.into(), i8::MAX.into()) as i8;
        }
        let highest = (1 << bits) - 1;
        let lowest = if bits == LONG_BITS { -highest } else { 0 };
        for (at, code) in (0..).zip(&mut codes.0) {
            *code = draw.integer(10, at, lowest, highest) as i16;
        }
        let weights = weights.0.get(..layout.bytes(rows, columns)).unwrap_or_default();
        let sums = |kernel: Self| {
            let mut sums = [-1; ROWS];
            let some = sums.get_mut(..rows).unwrap_or_default();
            kernel.sum_rows(layout, weights, codes.0.get(..columns).unwrap_or_default(), bits, some);
            sums
        };
        sums(self) == sums(Self::Portable)
    }

    fn rescales_alike(self, draw: Draw, bits: u32) -> bool {
        let count = draw.size(11, OUTPUTS);
        let numbers = |stream: u32, low: i32, high: i32| {
            let mut at = 0;
            [0; OUTPUTS].map(|_: i32| {
                at += 1;
                draw.integer(stream, at, low, high)
            })
        };
        let largest = i32::MAX >> (LONG_BITS - bits);
        let (multiplier, bias) = (numbers(12, 1, i32::MAX), numbers(13, -MAX_BIAS, MAX_BIAS));
        let factor = draw.integer(14, 0, 1, i32::MAX);
        let rescaled = |kernel: Self| {
            let mut sums = numbers(15, -largest, largest);
            let some = sums.get_mut(..count).unwrap_or_default();
            kernel.rescale(some, bits, &multiplier, factor, &bias);
            sums
        };
        rescaled(self) == rescaled(Self::Portable)
    }

    fn activates_alike(self, draw: Draw, bits: u32) -> bool {
        let count = draw.size(16, OUTPUTS);
        let mut pre = [0; OUTPUTS];
        for (at, pre) in (0..).zip(&mut pre) {
            // Within the table, at its ends, and anywhere.
            let range = if at % 2 == 0 { 1 << 17 } else { i32::MAX };
            *pre = draw.integer(17, at, -range, range);
        }
        let factor = draw.integer(18, 0, 1, i32::MAX);
        let codes = |kernel: Self| {
            let mut codes = OnWords([-1; OUTPUTS]);
            let some = codes.0.get_mut(..count).unwrap_or_default();
            kernel.activate(pre.get(..count).unwrap_or_default(), factor, bits, some);
            codes.0
        };
        codes(self) == codes(Self::Portable)
    }
}

/// The numbers of a round, each by its stream and place.
#[derive(Clone, Copy)]
struct Draw {
    noise: Noise,
    round: u32,
}

impl Draw {
    fn word(self, stream: u32, at: u32) -> u32 {
        let [word, ..] = self.noise.words(stream, self.round.into(), at);
        word
    }

    /// A size from 0 to `most`, often the largest.
    fn size(self, stream: u32, most: usize) -> usize {
        (below(self.word(stream, 0), most as u32 + most as u32 / 4) as usize).min(most)
    }

    /// An integer within two bounds, and one in four times a bound itself.
    fn integer(self, stream: u32, at: u32, low: i32, high: i32) -> i32 {
        let word = self.word(stream, at);
        match word % 8 {
            0 => low,
            1 => high,
            _ => {
                let span = u64::from(high.abs_diff(low)) + 1;
                low.wrapping_add_unsigned(((u64::from(word) * span) >> 32) as u32)
            }
        }
    }

    /// Numbers of any finite size and sign.
    fn floats(self, stream: u32, out: &mut [f32]) {
        for (at, value) in (0..).zip(out) {
            let word = self.word(stream, at);
            // Exponents of -26 to 6, so that sums round, and now and then a subnormal.
            let exponent = if word.is_multiple_of(16) { 0 } else { 101 + word % 32 };
            *value = f32::from_bits((word & 0x8000_0000) | exponent << 23 | (word >> 8 & 0x007F_FFFF));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kernel_of_this_machine_passes() {
        for kernel in Kernel::available() {
            assert_eq!(kernel.check(1, 500), Ok(()), "{}", kernel.name());
        }
    }
}
