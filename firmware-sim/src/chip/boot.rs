//! Booting: the active slot, or the other one if that is what is left.

use thiserror::Error;

use super::boot_log::{self, Entry, Reason};
use super::{Chip, ERASED, Slot};
use crate::flash::FlashFault;
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
    /// Whether it is on trial: unless [`Chip::confirm`] is called, the next
    /// boot rolls it back.
    pub on_trial: bool,
    /// Why the other slot was given up, where it was.
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
    /// The robot was reset before its trial was confirmed.
    #[error("its trial ended in a reset before it was confirmed")]
    NotConfirmed,
    /// It was given up at an earlier boot.
    #[error("it was rolled back at an earlier boot: {}", earlier(.0))]
    RolledBack(Reason),
}

const fn earlier(reason: &Reason) -> &'static str {
    match reason {
        Reason::Empty => "it was empty",
        Reason::Image => "its image was not whole and valid",
        Reason::Golden => "its golden trace was not reproduced",
        Reason::NotConfirmed => "its trial ended in a reset before it was confirmed",
    }
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
    /// The flash failed.
    #[error("the boot log cannot be kept: {0}")]
    Flash(#[from] FlashFault),
}

impl Chip {
    /// Boots the active slot: checks its image and replays its golden trace. A
    /// slot that is bad, or whose trial was not confirmed before this boot, is
    /// given up for the other one, and the log says why.
    ///
    /// # Errors
    /// [`BootError`]
    pub fn boot(&mut self) -> Result<Boot, BootError> {
        let entry = boot_log::latest(&mut self.flash)?.ok_or(BootError::Blank)?;
        let active = entry.active();
        let passed_over = match entry {
            Entry::Confirmed(_) => None,
            Entry::Trial(slot) => {
                boot_log::append(&mut self.flash, Entry::Tried(slot))?;
                None
            }
            Entry::Tried(slot) => return self.roll_back(slot, SlotFault::NotConfirmed),
            Entry::RolledBack(_, reason) => Some(SlotFault::RolledBack(reason)),
        };
        let on_trial = matches!(entry, Entry::Trial(_));
        match (self.boot_slot(active), passed_over) {
            (Ok(boot), _) => Ok(Boot { on_trial, passed_over, ..boot }),
            (Err(active_fault), None) => self.roll_back(active, active_fault),
            (Err(active_fault), Some(other_fault)) => Err(BootError::NoGoodSlot { active, active_fault, other_fault }),
        }
    }

    /// Ends the trial of the slot that booted: it is the policy from now on.
    ///
    /// # Errors
    /// [`FlashFault`]; the trial goes on then.
    pub fn confirm(&mut self) -> Result<(), FlashFault> {
        match boot_log::latest(&mut self.flash)? {
            Some(Entry::Tried(slot)) => boot_log::append(&mut self.flash, Entry::Confirmed(slot)),
            _ => Ok(()),
        }
    }

    /// Gives `slot` up and boots the other one. Where there is nothing to go
    /// back to, a trial that was not confirmed is repeated.
    fn roll_back(&mut self, slot: Slot, fault: SlotFault) -> Result<Boot, BootError> {
        let other_fault = match self.boot_slot(slot.other()) {
            Ok(boot) => {
                boot_log::append(&mut self.flash, Entry::RolledBack(slot, reason(fault)))?;
                return Ok(Boot { passed_over: Some(fault), ..boot });
            }
            Err(other_fault) => other_fault,
        };
        let active_fault = match fault {
            SlotFault::NotConfirmed => match self.boot_slot(slot) {
                Ok(boot) => return Ok(Boot { on_trial: true, ..boot }),
                Err(active_fault) => active_fault,
            },
            fault => fault,
        };
        Err(BootError::NoGoodSlot { active: slot, active_fault, other_fault })
    }

    pub(super) fn boot_slot(&self, slot: Slot) -> Result<Boot, SlotFault> {
        let memory = self.slot(slot);
        if memory.iter().all(|&byte| byte == ERASED) {
            return Err(SlotFault::Empty);
        }
        let checked = host::check(memory).map_err(SlotFault::Unfit)?;
        let image = AlignedBytes::from(checked.image.bytes());
        Ok(Boot { slot, image, golden_rows: checked.golden_rows, on_trial: false, passed_over: None })
    }
}

const fn reason(fault: SlotFault) -> Reason {
    match fault {
        SlotFault::Empty => Reason::Empty,
        SlotFault::Unfit(Unfit::Image(_)) => Reason::Image,
        SlotFault::Unfit(Unfit::Golden(_)) => Reason::Golden,
        SlotFault::NotConfirmed => Reason::NotConfirmed,
        SlotFault::RolledBack(reason) => reason,
    }
}
