//! Booting: the active slot, or the other one if that is what is left.

use thiserror::Error;

use super::{Chip, ERASED, Slot};
use crate::host::{self, Unfit};
use crate::memory::AlignedBytes;

/// A booted image.
#[derive(Clone, Debug, PartialEq)]
pub struct Boot {
    /// Where the image came from.
    pub slot: Slot,
    /// The image's bytes, without the rest of the slot.
    pub image: AlignedBytes,
    /// Rows of the golden trace that were replayed first.
    pub golden_rows: usize,
    /// Why the active slot was passed over, where it was.
    pub passed_over: Option<SlotFault>,
}

/// Why a slot does not boot.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum SlotFault {
    /// The slot is erased.
    #[error("it is empty")]
    Empty,
    /// What it holds must not fly.
    #[error("{0}")]
    Unfit(Unfit),
}

/// Why a chip does not boot.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum BootError {
    /// Nothing was ever flashed.
    #[error("the chip is blank; flash an image with firmware-sim flash")]
    Blank,
    /// Neither slot is good.
    #[error("no slot boots; {active}: {active_fault}; {}: {other_fault}; flash a good image", active.other())]
    NoGoodSlot {
        /// The slot that should boot.
        active: Slot,
        /// What is wrong with it.
        active_fault: SlotFault,
        /// What is wrong with the other.
        other_fault: SlotFault,
    },
}

impl Chip {
    /// Boots the active slot; checks its image and replays its golden trace.
    /// Where it is bad, boots the other slot in the same way.
    ///
    /// # Errors
    /// [`BootError`]
    pub fn boot(&self) -> Result<Boot, BootError> {
        let active = self.active().ok_or(BootError::Blank)?;
        self.boot_slot(active).or_else(|active_fault| {
            let other = self.boot_slot(active.other());
            let other = other.map(|boot| Boot { passed_over: Some(active_fault), ..boot });
            other.map_err(|other_fault| BootError::NoGoodSlot { active, active_fault, other_fault })
        })
    }

    fn boot_slot(&self, slot: Slot) -> Result<Boot, SlotFault> {
        let memory = self.slot(slot);
        if memory.iter().all(|&byte| byte == ERASED) {
            return Err(SlotFault::Empty);
        }
        let checked = host::check(memory).map_err(SlotFault::Unfit)?;
        let image = AlignedBytes::from(checked.image.bytes());
        Ok(Boot { slot, image, golden_rows: checked.golden_rows, passed_over: None })
    }
}
