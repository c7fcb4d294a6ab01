//! The boot log: which slot boots, and how far its trial has come.
//!
//! ```text
//! flash    -> Trial        the next boot tries the slot
//! boot     -> Tried        its trial has begun; golden trace, then flight
//! confirm  -> Confirmed    it is the policy from now on
//! boot     -> RolledBack   it was bad, or its trial ended in a reset: the other slot boots
//! ```

use armor_infer::log::{Log, LogError};

use super::Slot;
use crate::flash::{ERASE_BYTES, FlashFault, NorModel};

/// Where the log lies in flash: two erase blocks.
const REGION: std::ops::Range<u32> = 0..2 * ERASE_BYTES as u32;
/// Erase blocks of the log.
pub(super) const BLOCKS: usize = 2;

/// What the log says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Entry {
    /// The slot has a new image, to be tried at the next boot.
    Trial(Slot),
    /// Its trial has begun.
    Tried(Slot),
    /// It proved good.
    Confirmed(Slot),
    /// It did not: the other one boots.
    RolledBack(Slot, Reason),
}

/// Why a slot was given up, as it is kept in flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// The slot is erased.
    Empty,
    /// Its image is not whole and valid.
    Image,
    /// Its golden trace is not reproduced.
    Golden,
    /// The robot was reset before the trial was confirmed.
    NotConfirmed,
}

impl Entry {
    /// The slot that boots.
    pub(super) const fn active(self) -> Slot {
        match self {
            Self::Trial(slot) | Self::Tried(slot) | Self::Confirmed(slot) => slot,
            Self::RolledBack(slot, _) => slot.other(),
        }
    }

    /// The slot that holds no confirmed policy, where a new one may be put.
    pub(super) const fn spare(self) -> Slot {
        match self {
            Self::Trial(slot) | Self::Tried(slot) | Self::RolledBack(slot, _) => slot,
            Self::Confirmed(slot) => slot.other(),
        }
    }

    const fn words(self) -> [u32; 2] {
        let (stage, slot) = match self {
            Self::Trial(slot) => (0, slot),
            Self::Tried(slot) => (1, slot),
            Self::Confirmed(slot) => (2, slot),
            Self::RolledBack(slot, Reason::Empty) => (3, slot),
            Self::RolledBack(slot, Reason::Image) => (4, slot),
            Self::RolledBack(slot, Reason::Golden) => (5, slot),
            Self::RolledBack(slot, Reason::NotConfirmed) => (6, slot),
        };
        [stage, slot as u32]
    }

    const fn from_words([stage, slot]: [u32; 2]) -> Option<Self> {
        let slot = match slot {
            0 => Slot::A,
            1 => Slot::B,
            _ => return None,
        };
        Some(match stage {
            0 => Self::Trial(slot),
            1 => Self::Tried(slot),
            2 => Self::Confirmed(slot),
            3 => Self::RolledBack(slot, Reason::Empty),
            4 => Self::RolledBack(slot, Reason::Image),
            5 => Self::RolledBack(slot, Reason::Golden),
            6 => Self::RolledBack(slot, Reason::NotConfirmed),
            _ => return None,
        })
    }
}

/// What the log in a flash says; nothing on a new chip.
pub(super) fn latest(flash: &mut NorModel) -> Result<Option<Entry>, FlashFault> {
    let log = Log::open(flash, REGION).map_err(fault)?;
    Ok(log.latest().and_then(Entry::from_words))
}

/// Adds an entry, which counts as soon as it is whole.
pub(super) fn append(flash: &mut NorModel, entry: Entry) -> Result<(), FlashFault> {
    Log::open(flash, REGION).and_then(|mut log| log.append(entry.words())).map_err(fault)
}

fn fault(error: LogError<FlashFault>) -> FlashFault {
    match error {
        LogError::Flash(fault) => fault,
        // The region is a constant of whole blocks.
        LogError::Region => FlashFault::OutOfBounds,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_entry_is_read_as_it_was_written() {
        let mut flash = NorModel::erased(BLOCKS);
        assert_eq!(latest(&mut flash), Ok(None));
        let reasons = [Reason::Empty, Reason::Image, Reason::Golden, Reason::NotConfirmed];
        for slot in [Slot::A, Slot::B] {
            let rolled_back = reasons.map(|reason| Entry::RolledBack(slot, reason));
            for entry in [Entry::Trial(slot), Entry::Tried(slot), Entry::Confirmed(slot)].into_iter().chain(rolled_back)
            {
                append(&mut flash, entry).unwrap();
                assert_eq!(latest(&mut flash), Ok(Some(entry)));
            }
        }
    }
}
