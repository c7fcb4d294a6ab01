//! Boards that may fly a policy, and a model of how long an action takes on them.
//!
//! Nothing here was measured on a board: the instructions of an action's work
//! ([`Work`], [`mod@model`]) come from emulated cores, what an instruction costs
//! from manuals and published benchmarks (`cost.rs`). Every time is *modelled* and is labelled so.
//!
//! Words: *work* is what an action computes, counted by kind; a *cycle* is one
//! of the core's clock; a *stall* is a cycle in which the core waits for weights.

mod cost;
pub mod model;
mod work;

use thiserror::Error;

pub use work::Work;

/// A microcontroller board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Board {
    /// Its name on the command line.
    pub name: &'static str,
    /// The core that computes the actions.
    pub core: Core,
    /// Clock of the core in Hz.
    pub clock_hz: u32,
    /// Where the image lies.
    pub flash: Flash,
    /// Memory for data in bytes, all banks together.
    pub ram_bytes: usize,
    /// How much longer an action may take than modelled, as a share: what
    /// caches and interrupts do. An assumption.
    pub jitter: f64,
    /// Where the figures come from.
    pub source: &'static str,
}

/// A processor core.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Core {
    /// Arm Cortex-M0+, no floating point.
    M0Plus,
    /// Arm Cortex-M4 with single-precision floating point.
    M4F,
    /// Arm Cortex-M7 with floating point.
    M7,
    /// Arm Cortex-M33 with single-precision floating point.
    M33,
    /// RISC-V RV32IMC, no floating point.
    Rv32Imc,
}

/// Memory that holds the image, and what it takes to read weights from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flash {
    /// Size in bytes.
    pub bytes: usize,
    /// Cycles that the core waits for each byte of weights that streams through it.
    pub stalls_per_byte: f64,
}

/// Flash on the chip that delivers `line` bytes an access after `wait_states` cycles.
const fn internal(bytes: usize, wait_states: u32, line: u32) -> Flash {
    Flash { bytes, stalls_per_byte: wait_states as f64 / line as f64 }
}

/// Flash behind four wires at half the core's clock: two nibbles a byte, two cycles each.
const fn quad_spi(bytes: usize) -> Flash {
    Flash { bytes, stalls_per_byte: 4.0 }
}

const KIB: usize = 1024;
const MIB: usize = 1024 * KIB;

/// Every board.
pub const BOARDS: [Board; 8] = [
    Board {
        name: "stm32f407",
        core: Core::M4F,
        clock_hz: 168_000_000,
        // RM0090, table 10: 5 wait states at 168 MHz and 2.7 to 3.6 V; lines of 128 bits.
        flash: internal(MIB, 5, 16),
        ram_bytes: 192 * KIB,
        jitter: 0.05,
        source: "ST DS8626, RM0090",
    },
    Board {
        name: "stm32f746",
        core: Core::M7,
        clock_hz: 216_000_000,
        // RM0385, table 5: 7 wait states at 216 MHz and 2.7 to 3.6 V; lines of 256 bits.
        flash: internal(MIB, 7, 32),
        ram_bytes: 320 * KIB,
        jitter: 0.05,
        source: "ST DS10916, RM0385",
    },
    Board {
        name: "stm32h743",
        core: Core::M7,
        clock_hz: 480_000_000,
        // RM0433, table 17: 4 wait states at a bus of 240 MHz, two cycles of the core each; lines of 256 bits.
        flash: internal(2 * MIB, 8, 32),
        ram_bytes: MIB,
        jitter: 0.05,
        source: "ST DS12110, RM0433",
    },
    Board {
        name: "nrf52840",
        core: Core::M4F,
        clock_hz: 64_000_000,
        // The published cycles were taken from a core of this speed, cache on.
        flash: internal(MIB, 0, 16),
        ram_bytes: 256 * KIB,
        jitter: 0.05,
        source: "Nordic nRF52840 product specification",
    },
    Board {
        name: "nrf5340",
        core: Core::M33,
        clock_hz: 128_000_000,
        flash: internal(MIB, 0, 16),
        ram_bytes: 512 * KIB,
        jitter: 0.05,
        source: "Nordic nRF5340 product specification, application core",
    },
    Board {
        name: "rp2040",
        core: Core::M0Plus,
        clock_hz: 133_000_000,
        flash: quad_spi(2 * MIB),
        ram_bytes: 264 * KIB,
        jitter: 0.15,
        source: "Raspberry Pi RP2040 datasheet; flash of the Pico",
    },
    Board {
        name: "rp2350",
        core: Core::M33,
        clock_hz: 150_000_000,
        flash: quad_spi(4 * MIB),
        ram_bytes: 520 * KIB,
        jitter: 0.15,
        source: "Raspberry Pi RP2350 datasheet; flash of the Pico 2",
    },
    Board {
        name: "esp32-c3",
        core: Core::Rv32Imc,
        clock_hz: 160_000_000,
        flash: quad_spi(4 * MIB),
        ram_bytes: 384 * KIB,
        jitter: 0.15,
        source: "Espressif ESP32-C3 datasheet; flash of the DevKitM-1",
    },
];

/// No board has the name.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("no board is called {name}; the boards are host, {}", names())]
pub struct UnknownBoard {
    /// The name.
    pub name: String,
}

/// Why a policy does not fit a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum DoesNotFit {
    /// The image and a firmware are longer than the flash.
    #[error("the image is {image_bytes} bytes, and flash has {room} beside the firmware; export it as int8")]
    Flash {
        /// Length of the image.
        image_bytes: usize,
        /// What the flash has room for.
        room: usize,
    },
    /// The controller takes more memory than there is.
    #[error("the controller takes {needed} bytes of RAM and the board has {capacity}; train a narrower policy")]
    Ram {
        /// Memory of the controller.
        needed: usize,
        /// Memory of the board.
        capacity: usize,
    },
}

/// Flash that a firmware around the controller takes, generously.
const FIRMWARE_BYTES: usize = 64 * KIB;

impl Board {
    /// The board of a name.
    ///
    /// # Errors
    /// [`UnknownBoard`]
    pub fn named(name: &str) -> Result<&'static Self, UnknownBoard> {
        BOARDS.iter().find(|board| board.name == name).ok_or_else(|| UnknownBoard { name: name.into() })
    }

    /// Whether an image and a controller of `ram_bytes` go on the board.
    ///
    /// # Errors
    /// [`DoesNotFit`]
    pub const fn check_fit(&self, image_bytes: usize, ram_bytes: usize) -> Result<(), DoesNotFit> {
        let room = self.flash.bytes - FIRMWARE_BYTES;
        if image_bytes > room {
            return Err(DoesNotFit::Flash { image_bytes, room });
        }
        if ram_bytes > self.ram_bytes {
            return Err(DoesNotFit::Ram { needed: ram_bytes, capacity: self.ram_bytes });
        }
        Ok(())
    }
}

fn names() -> String {
    BOARDS.map(|board| board.name).join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_distinct_and_an_unknown_one_is_answered_with_the_list() {
        for board in &BOARDS {
            assert_eq!(Board::named(board.name), Ok(board));
        }
        let error = Board::named("arduino").unwrap_err().to_string();
        assert!(error.contains("arduino") && error.contains("esp32-c3"), "{error}");
    }

    #[test]
    fn what_is_too_large_is_named() {
        let board = Board::named("nrf52840").unwrap();
        assert_eq!(board.check_fit(960 * KIB, 256 * KIB), Ok(()));
        let (image_bytes, room) = (960 * KIB + 1, 960 * KIB);
        assert_eq!(board.check_fit(image_bytes, 0), Err(DoesNotFit::Flash { image_bytes, room }));
        let (needed, capacity) = (256 * KIB + 1, 256 * KIB);
        assert_eq!(board.check_fit(0, needed), Err(DoesNotFit::Ram { needed, capacity }));
    }
}
