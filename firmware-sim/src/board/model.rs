//! From work to instructions, cycles and time: modelled, not measured.
//!
//! ```text
//! instructions of a class = sum over features of the work: count x share
//! cycles                  = instructions x cycles of their class, calibrated
//!                           + bytes of weights x stalls of one
//! time                    = cycles / clock
//! ```
//!
//! The shares are solved from the instructions that emulated cores executed for
//! actions of several sizes ([`crate::mcu::record`]), so they are exact at
//! those sizes. What an instruction costs is in `cost.rs`.

use std::collections::BTreeMap;
use std::time::Duration;

use armor_core::image::{Layout, PolicyImage, Precision};
use nalgebra::{SMatrix, SVector};

use super::{Board, Core, Work};
use crate::mcu::record::{self, Action, Record};
use crate::mcu::{Class, SIZES};
use crate::sized;

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

impl Board {
    /// What an action along a rung takes; none if the image has no such rung.
    pub fn action(&self, image: &PolicyImage<'_>, rung: usize) -> Option<Modelled> {
        let manifest = image.manifest();
        Some(self.modelled(&Work::of(image, rung)?, manifest.precision, manifest.layout))
    }

    /// What work takes.
    pub fn modelled(&self, work: &Work, precision: Precision, layout: Layout) -> Modelled {
        let executed = executed(self.core, precision, layout, work);
        let cycles = self.core.cycles(&executed, precision) + work.weight_bytes as f64 * self.flash.stalls_per_byte;
        let time = cycles / f64::from(self.clock_hz);
        Modelled {
            instructions: executed.instructions(),
            cycles,
            time: Duration::from_secs_f64(time),
            worst: Duration::from_secs_f64(time * (1.0 + self.jitter)),
        }
    }
}

/// What instructions are counted by.
const FEATURES: usize = 5;
type Features = SVector<f64, FEATURES>;

fn features(work: &Work) -> Features {
    Features::from([work.macs as f64, work.activations as f64, work.normals as f64, work.steps as f64, 1.0])
}

/// The instructions of work on a core, by class.
fn executed(core: Core, precision: Precision, layout: Layout, work: &Work) -> Record {
    let records = record::recorded();
    let machine = core.machine();
    let record = |layout: Layout, (hidden, steps): (u16, u16)| {
        let format = record::format_name(precision, layout).into();
        records.get(&Action { machine: machine.into(), format, hidden, steps })
    };
    // Cores without 16-bit SIMD have no record of pairs: they read them by plain loops, as they do rows.
    let layout = if record(layout, SIZES[0]).is_some() { layout } else { Layout::Rows };
    let sizes: [(u16, u16); FEATURES] = std::array::from_fn(|size| SIZES[size]);
    let counted = sizes.map(|size| record(layout, size).cloned().unwrap_or_default());
    let rows = sizes.map(|(hidden, steps)| features(&sized_work(hidden, precision, steps)).transpose());
    let Some(inverse) = SMatrix::<f64, FEATURES, FEATURES>::from_rows(&rows).try_inverse() else {
        return Record::default();
    };
    // An inverse has a row a feature: their shares of what was counted.
    let predicted = |value: &dyn Fn(&Record) -> f64| {
        let counts = Features::from(std::array::from_fn(|size| value(&counted[size])));
        (inverse * counts).dot(&features(work)).max(0.0)
    };
    let of_class = |class: Class| predicted(&|record| record.classes.get(&class).copied().unwrap_or_default());
    Record {
        classes: Class::ALL.map(|class| (class, of_class(class))).into_iter().collect::<BTreeMap<_, _>>(),
        loaded_registers: predicted(&|record| record.loaded_registers),
    }
}

/// The work of an action of a sized policy; only DDPM draws noise on its way.
fn sized_work(hidden: u16, precision: Precision, steps: u16) -> Work {
    let shape = sized::shape(hidden);
    let noisy = if steps == shape.steps { steps - 1 } else { 0 };
    Work::new(&shape, precision, steps, noisy)
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

    /// The last size is recorded and takes no part in the shares.
    #[test]
    fn a_size_that_was_not_solved_for_is_predicted_to_two_per_cent() {
        let held_out = SIZES[FEATURES];
        for (Action { machine, format, hidden, steps }, record) in record::recorded().iter() {
            let (hidden, steps) = (*hidden, *steps);
            let formats = [
                (Precision::F32, Layout::Rows),
                (Precision::Int16x8, Layout::Rows),
                (Precision::Int16x8, Layout::Paired),
                (Precision::Int8, Layout::Rows),
                (Precision::Int8, Layout::Paired),
            ];
            let core = Core::ALL.into_iter().find(|core| core.machine() == machine);
            let Some(core) = core.filter(|_| (hidden, steps) == held_out) else { continue };
            let (precision, layout) = formats.into_iter().find(|&(p, l)| record::format_name(p, l) == *format).unwrap();
            let predicted = executed(core, precision, layout, &sized_work(hidden, precision, steps)).instructions();
            let error = predicted / record.instructions() - 1.0;
            assert!(error.abs() < 0.02, "{machine}, {format}: {error}");
        }
    }

    #[test]
    fn stalls_are_added_for_each_byte_of_weights() {
        let stm = Board::named("stm32f407").unwrap();
        let waits = |stalls_per_byte| Board { flash: Flash { bytes: 0, stalls_per_byte }, ..*stm };
        let work = sized_work(64, Precision::Int8, 1);
        let cycles = |stalls| waits(stalls).modelled(&work, Precision::Int8, Layout::Rows).cycles;
        assert!((cycles(0.5) - cycles(0.0) - 0.5 * work.weight_bytes as f64).abs() < 1e-6);
    }
}
