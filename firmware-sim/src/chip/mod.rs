//! A simulated chip: flash with a boot log and two policy slots, kept in a file.
//!
//! ```text
//! blocks 0, 1    boot log: which slot boots, and how far its trial has come
//! blocks 2..10   budget journal
//! then           slot A, slot B: an image each, from the slot's first byte on
//! ```
//!
//! An update goes to the slot that holds no confirmed policy, is read back, and
//! then tried: the log says so in a single record, so that power may be cut at
//! any write or erase and the old policy boots, or the new one, whole. Nothing
//! is ever written that does not check, whose golden trace does not replay,
//! that is for another task or robot, is an older release than the confirmed
//! policy or takes smaller budgets; and where the active slot has gone bad, the
//! other one boots, if that is good, and the log keeps the reason.

mod boot;
mod boot_log;
mod header;

use std::ops::Range;
use std::path::Path;

use armor_core::image::{Manifest, PolicyImage};
use armor_core::units::Cost;
use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use serde::Serialize;
use thiserror::Error;

use crate::file::{self, FileError};
use crate::flash::{ERASE_BYTES, FlashFault, NorModel, WRITE_BYTES};
use crate::host::{self, Unfit};
use crate::memory::AlignedBytes;
use boot_log::Entry;
use header::HEADER_BYTES;

pub use boot::{Boot, BootError, SlotFault};
pub use boot_log::Reason;
pub use header::HeaderError;

/// Erase blocks of the simulated flash.
const BLOCKS: usize = 512;
/// Size of the simulated flash.
pub const FLASH_BYTES: usize = BLOCKS * ERASE_BYTES;
/// Size of a chip file.
pub const FILE_BYTES: usize = HEADER_BYTES + FLASH_BYTES;
/// Erase blocks of the budget journal.
const JOURNAL_BLOCKS: usize = 8;
/// Where the budget journal lies in flash.
pub const JOURNAL: Range<u32> =
    (boot_log::BLOCKS * ERASE_BYTES) as u32..((boot_log::BLOCKS + JOURNAL_BLOCKS) * ERASE_BYTES) as u32;
/// What an image may take: half of what the logs leave, in whole blocks.
pub const SLOT_BYTES: usize = (BLOCKS - boot_log::BLOCKS - JOURNAL_BLOCKS) / 2 * ERASE_BYTES;
/// What erased flash reads.
const ERASED: u8 = 0xFF;

/// One of the two places for an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
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
    flash: NorModel,
}

/// Why a chip file cannot be used.
#[derive(Debug, Error)]
pub enum ChipError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is too short or too long.
    #[error("{path} is {actual} bytes and a chip file {FILE_BYTES}; it was cut or is another file, flash a new chip")]
    Size {
        /// The file.
        path: String,
        /// Its size.
        actual: usize,
    },
    /// The header cannot be read.
    #[error("{path}: {error}")]
    Header {
        /// The file.
        path: String,
        /// What is wrong.
        error: HeaderError,
    },
}

/// Why an image was not flashed; what booted before still boots.
#[derive(Clone, Debug, PartialEq, Error)]
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
    /// The chip flies another task.
    #[error("the chip flies {flown} and the image is for {image}; flash it to a chip of its own")]
    WrongTask {
        /// Task of the policy that boots.
        flown: String,
        /// Task of the image.
        image: String,
    },
    /// The robot has other sensors or actuators.
    #[error(
        "the chip's policy senses {} and moves {} entries, the image {} and {}; flash it to a chip of its own",
        flown[0], flown[1], image[0], image[1]
    )]
    WrongRobot {
        /// State and action entries of the policy that boots.
        flown: [u16; 2],
        /// Those of the image.
        image: [u16; 2],
    },
    /// The image was trained with smaller budgets: the robot's limit might be refused in the field.
    #[error(
        "the confirmed policy takes cost limits up to {confirmed} and the image up to {image}; train it with larger budgets"
    )]
    KappaRange {
        /// The largest limit of the confirmed policy.
        confirmed: Cost,
        /// That of the image.
        image: Cost,
    },
    /// The image is older than the confirmed policy.
    #[error(
        "the confirmed policy is release {confirmed} and the image release {image}; export it as release {confirmed} or later"
    )]
    Downgrade {
        /// Release of the confirmed policy.
        confirmed: u32,
        /// Release of the image.
        image: u32,
    },
    /// The slot named holds the policy to go back to.
    #[error("slot {slot} holds the confirmed policy, which stays until another is confirmed; leave out the slot")]
    Confirmed {
        /// The slot.
        slot: Slot,
    },
    /// The flash failed.
    #[error("the flash failed: {0}")]
    Flash(#[from] FlashFault),
    /// What was written is not what is read back.
    #[error("slot {slot} does not hold what was written to it; the flash is worn out, replace the chip")]
    ReadBack {
        /// The slot.
        slot: Slot,
    },
}

/// An image that was flashed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Flashed {
    /// Where it lies; the slot that is tried at the next boot.
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
            Self::A => JOURNAL.end as usize,
            Self::B => JOURNAL.end as usize + SLOT_BYTES,
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
    /// A new chip, all erased.
    pub fn blank() -> Self {
        Self { flash: NorModel::erased(BLOCKS) }
    }

    /// A chip with this flash; nothing where it is of another size.
    pub fn with_flash(flash: NorModel) -> Option<Self> {
        (flash.bytes().len() == FLASH_BYTES).then_some(Self { flash })
    }

    /// Its flash, for a firmware that writes the journal.
    pub fn into_flash(self) -> NorModel {
        self.flash
    }

    /// Words that were written to its flash and blocks erased, since it was made or read from its file.
    pub const fn operations(&self) -> u64 {
        self.flash.operations()
    }

    /// The first bit of a slot in flash.
    pub const fn slot_bit(slot: Slot) -> usize {
        8 * slot.start()
    }

    /// Reads a chip file.
    ///
    /// # Errors
    /// [`ChipError`]
    pub fn read(path: &Path) -> Result<Self, ChipError> {
        let bytes = file::read(path)?;
        let name = || path.display().to_string();
        // The magic first: a file of another kind is best called that.
        let wear = header::read(&bytes).map_err(|error| ChipError::Header { path: name(), error })?;
        let actual = bytes.len();
        let flash = bytes.get(HEADER_BYTES..FILE_BYTES).filter(|_| actual == FILE_BYTES);
        let flash = flash.ok_or_else(|| ChipError::Size { path: name(), actual })?;
        let flash = NorModel::restored(AlignedBytes::from(flash), wear);
        let flash = flash.ok_or_else(|| ChipError::Header { path: name(), error: HeaderError::Damaged })?;
        Ok(Self { flash })
    }

    /// Writes the chip file, aside and renamed.
    ///
    /// # Errors
    /// [`FileError`]
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        file::write(path, &[&header::bytes(self.flash.wear()), self.flash.bytes()].concat())
    }

    /// Puts an image into a slot, to be tried at the next boot: the one that
    /// holds no confirmed policy, where none is named. `bytes` start at a
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
        let entry = boot_log::latest(&mut self.flash)?;
        self.check_update(entry, checked.image.manifest())?;
        let spare = entry.map_or(Slot::A, Entry::spare);
        let slot = slot.unwrap_or(spare);
        if entry.is_some() && slot != spare {
            return Err(FlashError::Confirmed { slot });
        }
        self.program(slot, image)?;
        boot_log::append(&mut self.flash, Entry::Trial(slot))?;
        Ok(Flashed { slot, image_bytes: image.len(), golden_rows: checked.golden_rows })
    }

    /// Erases what is not erased of a slot, writes an image to it, and reads it back.
    fn program(&mut self, slot: Slot, image: &[u8]) -> Result<(), FlashError> {
        let start = slot.start();
        for block in (start..start + SLOT_BYTES).step_by(ERASE_BYTES) {
            if self.flash.bytes()[block..][..ERASE_BYTES].iter().any(|&byte| byte != ERASED) {
                self.flash.erase(block as u32, (block + ERASE_BYTES) as u32)?;
            }
        }
        let mut words = image.to_vec();
        words.resize(image.len().next_multiple_of(WRITE_BYTES), ERASED);
        self.flash.write(start as u32, &words)?;
        let mut written = vec![0; words.len()];
        self.flash.read(start as u32, &mut written)?;
        if written == words { Ok(()) } else { Err(FlashError::ReadBack { slot }) }
    }

    /// Whether an image may follow the policy that boots, and the confirmed one that it may replace.
    fn check_update(&self, entry: Option<Entry>, image: &Manifest<'_>) -> Result<(), FlashError> {
        let Some(entry) = entry else { return Ok(()) };
        if let Some(flown) = self.manifest(entry.active()) {
            if flown.task != image.task {
                return Err(FlashError::WrongTask { flown: flown.task.into(), image: image.task.into() });
            }
            let [flown, image] = [&flown, image].map(|manifest| [manifest.shape.state, manifest.shape.action]);
            if flown != image {
                return Err(FlashError::WrongRobot { flown, image });
            }
        }
        if let Some(confirmed) = self.manifest(entry.spare().other()) {
            let [confirmed_max, image_max] = [&confirmed, image].map(|manifest| manifest.kappa.trained_max);
            if image_max < confirmed_max {
                return Err(FlashError::KappaRange { confirmed: confirmed_max, image: image_max });
            }
            if image.release < confirmed.release {
                return Err(FlashError::Downgrade { confirmed: confirmed.release, image: image.release });
            }
        }
        Ok(())
    }

    /// What the image in a slot says of itself, where there is one.
    fn manifest(&self, slot: Slot) -> Option<Manifest<'_>> {
        PolicyImage::new_checked(self.slot(slot)).ok().map(|image| image.manifest().clone())
    }

    fn slot(&self, slot: Slot) -> &[u8] {
        &self.flash.bytes()[slot.start()..][..SLOT_BYTES]
    }
}

#[cfg(test)]
mod tests;
