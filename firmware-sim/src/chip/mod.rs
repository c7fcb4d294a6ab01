//! A simulated chip: flash with two policy slots and a boot record, kept in a file.
//!
//! ```text
//! sector 0     boot record: magic, version, length, checksum, which slot is active
//! then         slot A, slot B: an image each, from the slot's first byte on
//! ```
//!
//! Flash is erased to 0xFF in sectors. Nothing that does not check, or whose
//! golden trace does not replay, is ever written to a slot; and a chip whose
//! active slot has gone bad boots the other one, if that is good, and says so.

mod boot;
mod record;

use std::path::Path;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::file::{self, FileError};
use crate::host::{self, Unfit};
use crate::memory::AlignedBytes;
use record::BootRecord;

pub use boot::{Boot, BootError, SlotFault};
pub use record::RecordError;

/// Size of the simulated flash.
pub const FLASH_BYTES: usize = 2 * 1024 * 1024;
/// Flash is erased in sectors of this size.
const SECTOR_BYTES: usize = 4096;
/// What an image may take: half of what the boot record leaves, in whole sectors.
pub const SLOT_BYTES: usize = (FLASH_BYTES - SECTOR_BYTES) / 2 / SECTOR_BYTES * SECTOR_BYTES;
/// What erased flash reads.
const ERASED: u8 = 0xFF;

/// One of the two places for an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Slot {
    /// The first.
    A,
    /// The second.
    B,
}

/// A chip with its flash.
#[derive(Clone, Debug, PartialEq)]
pub struct Chip {
    flash: AlignedBytes,
    record: BootRecord,
}

/// Why a chip file cannot be used.
#[derive(Debug, Error)]
pub enum ChipError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is too short or too long.
    #[error("{path} is {actual} bytes and a chip file {FLASH_BYTES}; it was cut or is another file, flash a new chip")]
    Size {
        /// The file.
        path: String,
        /// Its size.
        actual: usize,
    },
    /// The boot record cannot be read.
    #[error("{path}: {error}")]
    Record {
        /// The file.
        path: String,
        /// What is wrong.
        error: RecordError,
    },
}

/// Why an image was not flashed; the chip is as it was.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum FlashError {
    /// The image is longer than a slot.
    #[error("the image is {bytes} bytes and a slot {SLOT_BYTES}; export a smaller network")]
    TooLarge {
        /// Length of the image.
        bytes: usize,
    },
    /// The image must not fly.
    #[error("refused to flash: {0}")]
    Unfit(#[from] Unfit),
}

/// An image that was flashed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Flashed {
    /// Where it lies; the slot that boots from now on.
    pub slot: Slot,
    /// Length of the image.
    pub image_bytes: usize,
    /// Rows of the golden trace that were replayed first.
    pub golden_rows: usize,
}

impl Slot {
    /// The other one.
    pub const fn other(self) -> Self {
        match self {
            Self::A => Self::B,
            Self::B => Self::A,
        }
    }

    /// Offset of the slot in flash.
    const fn start(self) -> usize {
        match self {
            Self::A => SECTOR_BYTES,
            Self::B => SECTOR_BYTES + SLOT_BYTES,
        }
    }
}

impl std::fmt::Display for Slot {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::A => "A",
            Self::B => "B",
        })
    }
}

impl Chip {
    /// A chip with erased slots.
    pub fn blank() -> Self {
        Self { flash: AlignedBytes::filled(ERASED, FLASH_BYTES), record: BootRecord { active: None } }
    }

    /// Reads a chip file.
    ///
    /// # Errors
    /// [`ChipError`]
    pub fn read(path: &Path) -> Result<Self, ChipError> {
        let flash = AlignedBytes::read(path)?;
        let name = || path.display().to_string();
        // The magic first: a file of another kind is best called that.
        let record = BootRecord::read(flash.as_slice()).map_err(|error| ChipError::Record { path: name(), error })?;
        let actual = flash.as_slice().len();
        if actual != FLASH_BYTES {
            return Err(ChipError::Size { path: name(), actual });
        }
        Ok(Self { flash, record })
    }

    /// Writes the chip file, aside and renamed.
    ///
    /// # Errors
    /// [`FileError`]
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let mut flash = self.flash.clone();
        self.record.write(&mut flash.as_mut_slice()[..SECTOR_BYTES]);
        file::write(path, flash.as_slice())
    }

    /// Puts an image into a slot and makes that slot the one that boots; the
    /// slot that does not boot now, where none is named. `bytes` start at a
    /// multiple of 16.
    ///
    /// # Errors
    /// [`FlashError`]
    pub fn flash(&mut self, bytes: &[u8], slot: Option<Slot>) -> Result<Flashed, FlashError> {
        let checked = host::check(bytes)?;
        let image = checked.image.bytes();
        if image.len() > SLOT_BYTES {
            return Err(FlashError::TooLarge { bytes: image.len() });
        }
        let slot = slot.unwrap_or(self.record.active.map_or(Slot::A, Slot::other));
        let memory = &mut self.flash.as_mut_slice()[slot.start()..][..SLOT_BYTES];
        memory.fill(ERASED);
        memory[..image.len()].copy_from_slice(image);
        self.record.active = Some(slot);
        Ok(Flashed { slot, image_bytes: image.len(), golden_rows: checked.golden_rows })
    }

    /// The slot that boots; none on a new chip.
    pub const fn active(&self) -> Option<Slot> {
        self.record.active
    }

    fn slot(&self, slot: Slot) -> &[u8] {
        &self.flash.as_slice()[slot.start()..][..SLOT_BYTES]
    }
}

#[cfg(test)]
mod tests;
