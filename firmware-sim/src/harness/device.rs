//! The controller as a thing: its chip, and what lies in its RAM.

use thiserror::Error;

use crate::chip::{Boot, BootError, Chip, FlashError, Slot};
use crate::flash::FlashFault;
use crate::memory::AlignedBytes;

/// A robot's controller, which goes on from episode to episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Device {
    pub(super) chip: Chip,
    pub(super) memory: AlignedBytes,
}

/// Why a new chip does not fly an image.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum NotFlashed {
    /// The image was refused.
    #[error(transparent)]
    Refused(#[from] FlashError),
    /// The chip does not boot.
    #[error(transparent)]
    Boot(#[from] BootError),
    /// The flash failed.
    #[error("the flash failed: {0}")]
    Flash(#[from] FlashFault),
}

impl Device {
    /// The controller of a chip that has booted.
    pub fn new(chip: Chip, boot: &Boot) -> Self {
        Self { chip, memory: boot.image.clone() }
    }

    /// A new chip with an image in both slots, booted and confirmed.
    ///
    /// # Errors
    /// [`NotFlashed`]
    pub fn flashed(image: &[u8]) -> Result<Self, NotFlashed> {
        let mut chip = Chip::blank();
        for _ in [Slot::A, Slot::B] {
            chip.flash(image, None)?;
            chip.boot()?;
            chip.confirm()?;
        }
        let boot = chip.boot()?;
        Ok(Self::new(chip, &boot))
    }

    /// Switches the controller off and on; whether a slot was passed over.
    ///
    /// # Errors
    /// [`BootError`]; it does not fly any more then.
    pub fn reboot(&mut self) -> Result<bool, BootError> {
        let boot = self.chip.boot()?;
        self.memory = boot.image;
        Ok(boot.passed_over.is_some())
    }

    /// The chip, as flights left it.
    pub fn into_chip(self) -> Chip {
        self.chip
    }

    /// The chip, as flights left it.
    pub const fn chip(&self) -> &Chip {
        &self.chip
    }

    /// The image that flies.
    pub fn image(&self) -> &[u8] {
        self.memory.as_slice()
    }
}
