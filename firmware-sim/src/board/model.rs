//! From work to instructions, cycles and time: modelled, not measured.
//!
//! ```text
//! instructions = sum over kinds of work: count x instructions of one
//! cycles       = instructions x cycles of one + bytes of weights x stalls of one
//! time         = cycles / clock
//! ```
//!
//! Provisional: instructions of a multiply-accumulate are those of plain Rust
//! loops under QEMU 7.2; cycles of an instruction are what MLPerf Tiny results
//! (anomaly detection, fully connected layers) divided by the instructions of
//! CMSIS-NN's kernels come to.

use std::time::Duration;

use armor_core::image::{PolicyImage, Precision};

use super::{Board, Core, Work};

/// What an action takes on a board, modelled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Modelled {
    /// Instructions executed.
    pub instructions: f64,
    /// Cycles of the core's clock.
    pub cycles: f64,
    /// The same as a time.
    pub time: Duration,
    /// The longest time that the board's jitter makes of it.
    pub worst: Duration,
}

/// Instructions of one operation of each kind.
struct Instructions {
    mac: f64,
    activation: f64,
    rescale: f64,
    entry: f64,
    normal: f64,
    step: f64,
}

impl Board {
    /// What an action along a rung takes; none if the image has no such rung.
    pub fn action(&self, image: &PolicyImage<'_>, rung: usize) -> Option<Modelled> {
        Some(self.modelled(&Work::of(image, rung)?, image.manifest().precision))
    }

    /// What work takes.
    pub fn modelled(&self, work: &Work, precision: Precision) -> Modelled {
        let main = instructions(self.core, precision);
        let float = instructions(self.core, Precision::F32);
        let count = |number: u64, each: f64| number as f64 * each;
        let in_precision = count(work.macs, main.mac)
            + count(work.activations, main.activation)
            + count(work.rescales, main.rescale)
            + count(work.entries, main.entry)
            + count(work.steps, main.step);
        let in_float = count(work.float_macs, float.mac)
            + count(work.float_activations, float.activation)
            + count(work.normals, float.normal);
        let cycles = in_precision * cycles_per_instruction(self.core, precision)
            + in_float * cycles_per_instruction(self.core, Precision::F32)
            + count(work.weight_bytes, self.flash.stalls_per_byte);
        let time = cycles / f64::from(self.clock_hz);
        Modelled {
            instructions: in_precision + in_float,
            cycles,
            time: Duration::from_secs_f64(time),
            worst: Duration::from_secs_f64(time * (1.0 + self.jitter)),
        }
    }
}

/// Instructions of each kind of work, by core and precision.
const fn instructions(core: Core, precision: Precision) -> Instructions {
    // A soft-float addition or multiplication of compiler-builtins is about 45 instructions.
    let mac = match (core, precision) {
        (Core::M4F | Core::M33, Precision::F32) => 3.9,
        (Core::M7, Precision::F32) => 2.9,
        (Core::M0Plus | Core::Rv32Imc, Precision::F32) => 95.0,
        (Core::M7, _) => 5.35,
        (_, _) => 4.84,
    };
    let has_float = matches!(core, Core::M4F | Core::M7 | Core::M33);
    match precision {
        // One exponential and one division a unit; soft float about 20 operations of 45.
        Precision::F32 => {
            let soft = if has_float { 1.0 } else { 15.0 };
            let [activation, entry, normal] = [60.0 * soft, 12.0 * soft, 150.0 * soft];
            Instructions { mac, activation, rescale: 0.0, entry, normal, step: 400.0 }
        }
        Precision::Int16x8 | Precision::Int8 => {
            Instructions { mac, activation: 24.0, rescale: 12.0, entry: 20.0, normal: 0.0, step: 400.0 }
        }
    }
}

/// Cycles of an instruction: 9.5, 5.5 cycles a MAC over 5.08 instructions in
/// single precision (M4F, M7), and 2.12, 1.28, 1.98 over 2.07 in 8 bits (M4F,
/// M7, M33). For the other cores nothing was published that could be divided
/// so: one cycle, and a quarter for branches and loads.
const fn cycles_per_instruction(core: Core, precision: Precision) -> f64 {
    match (core, precision) {
        (Core::M4F | Core::M33, Precision::F32) => 1.87,
        (Core::M7, Precision::F32) => 1.08,
        (Core::M4F, _) => 1.02,
        (Core::M7, _) => 0.62,
        (Core::M33, _) => 0.96,
        (Core::M0Plus | Core::Rv32Imc, _) => 1.25,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::{BOARDS, Flash};
    use crate::fixture;
    use crate::memory::AlignedBytes;

    #[test]
    fn a_longer_chain_takes_longer_and_a_faster_clock_less_time() {
        let memory = AlignedBytes::from(fixture::ball_run(1).as_slice());
        let image = PolicyImage::new_checked(memory.as_slice()).unwrap();
        for board in &BOARDS {
            let [long, short] = [0, 1].map(|rung| board.action(&image, rung).unwrap());
            assert!(short.time < long.time && long.time <= long.worst, "{}", board.name);
            assert!((long.time.as_secs_f64() * f64::from(board.clock_hz) / long.cycles - 1.0).abs() < 1e-3);
            let twice = Board { clock_hz: 2 * board.clock_hz, ..*board }.action(&image, 0).unwrap();
            assert_eq!(twice.cycles, long.cycles);
            assert!((twice.time.as_secs_f64() / long.time.as_secs_f64() - 0.5).abs() < 1e-3);
        }
    }

    /// 1000 multiply-accumulates and nothing else, by hand.
    #[test]
    fn cycles_are_instructions_and_stalls() {
        let flash = Flash { bytes: 0, stalls_per_byte: 0.5 };
        let board = Board { flash, jitter: 0.1, ..*Board::named("stm32f407").unwrap() };
        let modelled = board.modelled(&Work { macs: 1000, weight_bytes: 4000, ..Work::default() }, Precision::F32);
        assert_eq!(modelled.instructions, 3900.0);
        assert!((modelled.cycles - (3900.0 * 1.87 + 2000.0)).abs() < 1e-6);
        assert!((modelled.worst.as_secs_f64() / modelled.time.as_secs_f64() - 1.1).abs() < 1e-3);
    }
}
