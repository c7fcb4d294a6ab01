//! The boards that QEMU emulates.

use std::path::Path;
use std::process::Command;

/// An emulated board and its processor core.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Machine {
    /// Its name, as `firmware-sim/mcu/build.sh` knows it.
    pub name: &'static str,
    /// Its processor core.
    pub core: &'static str,
    /// QEMU's program for it.
    pub emulator: &'static str,
    /// QEMU's name of the board.
    board: &'static str,
}

const ARM: &str = "qemu-system-arm";
const RISCV: &str = "qemu-system-riscv32";

/// Every board that there is firmware for.
pub const MACHINES: [Machine; 7] = [
    Machine { name: "mps2-an385", core: "Cortex-M3 (soft float)", emulator: ARM, board: "mps2-an385" },
    Machine { name: "mps2-an386", core: "Cortex-M4F", emulator: ARM, board: "mps2-an386" },
    Machine { name: "mps2-an500", core: "Cortex-M7", emulator: ARM, board: "mps2-an500" },
    Machine { name: "mps2-an505", core: "Cortex-M33", emulator: ARM, board: "mps2-an505" },
    Machine { name: "mps3-an547", core: "Cortex-M55", emulator: ARM, board: "mps3-an547" },
    Machine { name: "rv32imac", core: "RV32IMAC (soft float)", emulator: RISCV, board: "virt" },
    Machine { name: "rv32imafc", core: "RV32IMAFC", emulator: RISCV, board: "virt" },
];

impl Machine {
    /// The machine of a name.
    ///
    /// # Errors
    /// The names that there are.
    pub fn named(name: &str) -> Result<&'static Self, String> {
        MACHINES.iter().find(|machine| machine.name == name).ok_or_else(|| {
            let names = MACHINES.map(|machine| machine.name).join(", ");
            format!("there is no machine {name}; choose from {names}")
        })
    }

    /// The emulator, about to run `firmware` with an image at `slot` of its flash.
    pub(super) fn command(&self, firmware: &Path, image: &Path, slot: u64) -> Command {
        let mut command = Command::new(self.emulator);
        command.args(["-M", self.board, "-display", "none", "-monitor", "none"]);
        if self.emulator == RISCV {
            command.args(["-bios", "none"]);
        }
        command.arg("-kernel").arg(firmware);
        command.arg("-device").arg(format!("loader,file={},addr={slot:#x},force-raw=on", image.display()));
        command
    }

    /// Whether its core has the 16-bit SIMD that reads weights in pairs of rows.
    pub fn has_dsp(&self) -> bool {
        ["Cortex-M4F", "Cortex-M7", "Cortex-M33", "Cortex-M55"].contains(&self.core)
    }

    /// Debian's package of the emulator.
    pub(super) const fn package(&self) -> &'static str {
        match self.emulator.as_bytes() {
            b"qemu-system-arm" => "qemu-system-arm",
            _ => "qemu-system-misc",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_has_its_name_and_an_unknown_one_is_answered_with_the_list() {
        for machine in &MACHINES {
            assert_eq!(Machine::named(machine.name), Ok(machine));
        }
        assert!(Machine::named("mps2-an521").unwrap_err().contains("mps2-an505, mps3-an547"));
    }
}
