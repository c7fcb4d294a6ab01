//! What an instruction of a class costs, in cycles.
//!
//! The costs are those of the cores' manuals. With the wait states of the board
//! that was measured, they are calibrated on what MLPerf Tiny results (anomaly
//! detection: fully connected layers in 8 bits) come to, in cycles a
//! multiply-accumulate, for the loop of CMSIS-NN that those results run.

use armor_core::image::Precision;

use super::Core;
use crate::mcu::Class;
use crate::mcu::record::Record;

/// Cycles of an instruction of each kind.
struct Costs {
    load: f64,
    /// Of a load of several registers, beside its registers.
    load_multiple: f64,
    /// Of each register of such a load.
    register: f64,
    store: f64,
    branch: f64,
    /// Multiplications, 16-bit SIMD among them.
    multiply: f64,
    divide: f64,
    /// Additions, products, conversions and moves in single precision.
    float: f64,
    float_mac: f64,
    float_divide: f64,
    other: f64,
}

impl Core {
    /// The cores.
    pub const ALL: [Self; 5] = [Self::M0Plus, Self::M4F, Self::M7, Self::M33, Self::Rv32Imc];

    /// The emulated machine that counts its instructions. The build for a
    /// Cortex-M0 runs on a Cortex-M3; compressed instructions count as others.
    pub const fn machine(self) -> &'static str {
        match self {
            Self::M0Plus => "mps2-an385",
            Self::M4F => "mps2-an386",
            Self::M7 => "mps2-an500",
            Self::M33 => "mps2-an505",
            Self::Rv32Imc => "rv32imac",
        }
    }

    /// Cycles of executed instructions, without the stalls of flash.
    pub(super) fn cycles(self, executed: &Record, precision: Precision) -> f64 {
        let calibration = if precision == Precision::F32 { 1.0 } else { self.calibration() };
        calibration * self.uncalibrated(executed)
    }

    fn uncalibrated(self, executed: &Record) -> f64 {
        let costs = self.costs();
        let cost = |class: Class| match class {
            Class::Load => costs.load,
            Class::LoadMultiple => costs.load_multiple,
            Class::Store => costs.store,
            Class::Branch => costs.branch,
            Class::Multiply | Class::SimdMac => costs.multiply,
            Class::Divide => costs.divide,
            Class::Float | Class::FloatMultiply => costs.float,
            Class::FloatMac => costs.float_mac,
            Class::FloatDivide => costs.float_divide,
            Class::Extend | Class::Integer | Class::Vector => costs.other,
        };
        executed.classes.iter().map(|(class, count)| count * cost(*class)).sum::<f64>()
            + costs.register * executed.loaded_registers
    }

    const fn costs(self) -> Costs {
        match self {
            // Cortex-M4 TRM, 3.3.1 and 7.2.3: loads 2 cycles and 1 behind another, so 1.5; LDM and VLDM 1 + N;
            // a branch 1, taken 2 to 4; SMLAD, MLA, VMUL, VADD 1; VFMA 3; VDIV 14; SDIV 2 to 12.
            // Arm publishes no such table for the Cortex-M33, which has as many stages and issues as much.
            Self::M4F | Self::M33 => Costs {
                load: 1.5,
                load_multiple: 1.0,
                register: 1.0,
                store: 1.0,
                branch: 2.5,
                multiply: 1.0,
                divide: 7.0,
                float: 1.0,
                float_mac: 3.0,
                float_divide: 14.0,
                other: 1.0,
            },
            // Cortex-M7: two instructions a cycle, of which one may multiply and one may be of the FPU; loads of 64
            // bits a cycle; branches predicted (TRM, 1.2 and 3.3). VDIV 16 as on other FPv5.
            Self::M7 => Costs {
                load: 0.5,
                load_multiple: 0.0,
                register: 0.5,
                store: 0.5,
                branch: 1.0,
                multiply: 1.0,
                divide: 10.0,
                float: 1.0,
                float_mac: 1.0,
                float_divide: 16.0,
                other: 0.5,
            },
            // Cortex-M0+ TRM, table 3-1: loads and stores 2, LDM 1 + N, a taken branch 2, MULS 1 with the fast multiplier.
            Self::M0Plus => Costs {
                load: 2.0,
                load_multiple: 1.0,
                register: 1.0,
                store: 2.0,
                branch: 1.8,
                multiply: 1.0,
                divide: 1.0,
                float: 1.0,
                float_mac: 1.0,
                float_divide: 1.0,
                other: 1.0,
            },
            // Espressif publishes no table; assumed for a four-stage pipeline: loads 2, branches 2.
            Self::Rv32Imc => Costs {
                load: 2.0,
                load_multiple: 0.0,
                register: 0.0,
                store: 1.0,
                branch: 2.0,
                multiply: 1.0,
                divide: 16.0,
                float: 1.0,
                float_mac: 1.0,
                float_divide: 1.0,
                other: 1.0,
            },
        }
    }

    /// Cycles a multiply-accumulate that were published, least and most, and the
    /// stalls in them: of the flash of a Nucleo-L4R5ZI (5 wait states for 16
    /// bytes, RM0432) and of a Nucleo-F746ZG (7 for 32, RM0385). None where
    /// nothing was, or by another kind of loop.
    const fn published(self) -> Option<(f64, f64, f64)> {
        match self {
            Self::M4F => Some((1.84, 2.39, 5.0 / 16.0)),
            Self::M7 => Some((1.15, 1.40, 7.0 / 32.0)),
            Self::M33 => Some((1.87, 3.04, 0.0)),
            Self::M0Plus | Self::Rv32Imc => None,
        }
    }

    /// What the costs are multiplied by, so that the loop of CMSIS-NN takes the
    /// middle of what was published.
    fn calibration(self) -> f64 {
        self.published()
            .map_or(1.0, |(least, most, stalls)| (0.5 * (least + most) - stalls) / self.uncalibrated(&cmsis_nn()))
    }

    /// How far published figures lie from the calibrated model, as a share.
    pub fn error(self) -> Option<f64> {
        self.published().map(|(least, most, _)| (most - least) / (most + least))
    }
}

/// A multiply-accumulate of `arm_nn_vec_mat_mult_t_s8` (CMSIS-NN, with DSP):
/// eight of them are 3 loads, 6 extensions and 4 SMLAD, and the loop counts,
/// moves and branches; a row's end adds 3.5 % (2.07 instructions in all).
fn cmsis_nn() -> Record {
    let classes =
        [(Class::Load, 3.0), (Class::Extend, 6.0), (Class::SimdMac, 4.0), (Class::Integer, 2.0), (Class::Branch, 1.0)];
    Record {
        classes: classes.map(|(class, count)| (class, 1.035 * count / 8.0)).into_iter().collect(),
        loaded_registers: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_calibrated_loop_takes_the_middle_of_what_was_published() {
        assert!((cmsis_nn().instructions() - 2.07).abs() < 1e-3);
        for (core, cycles) in [(Core::M4F, 2.115), (Core::M7, 1.275), (Core::M33, 2.455)] {
            let (.., stalls) = core.published().unwrap();
            assert!((core.cycles(&cmsis_nn(), Precision::Int8) + stalls - cycles).abs() < 1e-9);
            // The manuals' costs are near what was published before any calibration.
            assert!((0.7..1.3).contains(&core.calibration()), "{core:?}: {}", core.calibration());
        }
    }
}
