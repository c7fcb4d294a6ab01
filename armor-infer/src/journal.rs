//! The budget's log in flash: a reset or a power cut never refills it.
//!
//! What a reset leaves unknown is the cost of the action that was under way.
//! So the log does not hold kappa itself but a *floor* below it, and no action
//! is taken unless kappa less the worst cost of a step is at least the floor
//! on flash. After a reset the floor is what is left: the interrupted action
//! is charged as the worst, and nothing is ever given back.
//!
//! ```text
//! record    sequence, floor (2^-16), kind, CRC-32 of these: 16 bytes, little-endian
//! begin     the floor of a new episode; the only record that may raise it
//! lower     a floor below the one before
//! ```
//!
//! Records fill the erase blocks of a region one after the other, round and
//! round, and each is written before the action that it covers. The valid one
//! with the highest sequence counts; one that power was cut in is invalid and
//! does not. Where no record is valid, nothing is left.
//!
//! Floors fall in steps of a *reserve*: the larger it is, the fewer records are
//! written and the more an interrupted episode forfeits. A record is written
//! once for each reserve of cost that is incurred, and one for each episode.

use core::ops::Range;

use armor_core::units::Cost;
use crc::{CRC_32_ISO_HDLC, Crc};
use embedded_storage::nor_flash::NorFlash;

/// Bytes of a record; a flash must write and read in units that divide it.
pub const RECORD_BYTES: u32 = 16;
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
const BEGIN: u32 = u32::from_le_bytes(*b"BEGN");
const LOWER: u32 = u32::from_le_bytes(*b"LOWR");

/// How far below kappa a floor lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reserve {
    /// The largest cost that one step can incur.
    pub step: Cost,
    /// What a floor leaves beyond that, to be incurred before the next record.
    pub ahead: Cost,
}

/// The log of a budget in a region of a flash.
#[derive(Debug)]
pub struct Journal<F> {
    flash: F,
    region: Range<u32>,
    reserve: Reserve,
    /// Where the next record goes.
    next: u32,
    sequence: u32,
    floor: Cost,
}

/// Why the log cannot be kept. No action may be taken then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JournalError<E> {
    /// The region is not of at least two whole erase blocks within the flash,
    /// or the flash writes or reads in units that do not divide a record.
    Region,
    /// The flash failed.
    Flash(E),
}

impl<E: core::fmt::Debug> core::fmt::Display for JournalError<E> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Region => {
                f.write_str("the journal needs two or more whole erase blocks, and a flash that writes 16 bytes")
            }
            Self::Flash(error) => write!(f, "the flash failed ({error:?}); the budget cannot be kept, stop the robot"),
        }
    }
}

impl<E: core::fmt::Debug> core::error::Error for JournalError<E> {}

/// A record that counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Record {
    sequence: u32,
    floor: Cost,
    kind: u32,
}

impl Record {
    fn bytes(self) -> [u8; RECORD_BYTES as usize] {
        let mut bytes = [0; RECORD_BYTES as usize];
        let words = [self.sequence, self.floor.to_raw(), self.kind];
        for (out, byte) in bytes.iter_mut().zip(words.into_iter().flat_map(u32::to_le_bytes)) {
            *out = byte;
        }
        let check = CRC.checksum(&bytes[..12]);
        bytes[12..].copy_from_slice(&check.to_le_bytes());
        bytes
    }

    fn read(bytes: &[u8; RECORD_BYTES as usize]) -> Option<Self> {
        let ([sequence, floor, kind, check], _) = bytes.as_chunks::<4>() else { return None };
        let kind = u32::from_le_bytes(*kind);
        let is_whole = CRC.checksum(&bytes[..12]) == u32::from_le_bytes(*check) && (kind == BEGIN || kind == LOWER);
        let floor = Cost::from_raw(u32::from_le_bytes(*floor));
        is_whole.then_some(Self { sequence: u32::from_le_bytes(*sequence), floor, kind })
    }
}

impl<F: NorFlash> Journal<F> {
    /// Finds the log in `region`, in bytes of the flash, after a reset. What is
    /// left of the interrupted episode is [`Journal::remaining`].
    ///
    /// # Errors
    /// [`JournalError`]
    pub fn open(mut flash: F, region: Range<u32>, reserve: Reserve) -> Result<Self, JournalError<F::Error>> {
        let block = F::ERASE_SIZE as u32;
        let divides = |unit: usize| unit != 0 && (RECORD_BYTES as usize).is_multiple_of(unit);
        let is_whole = block != 0
            && block.is_multiple_of(RECORD_BYTES)
            && region.start.is_multiple_of(block)
            && region.end.is_multiple_of(block)
            && region.end.saturating_sub(region.start) >= 2 * block
            && region.end as usize <= flash.capacity();
        if !is_whole || !divides(F::WRITE_SIZE) || !divides(F::READ_SIZE) {
            return Err(JournalError::Region);
        }
        let mut latest: Option<(u32, Record)> = None;
        for at in region.clone().step_by(RECORD_BYTES as usize) {
            if let Some(record) = Record::read(&read(&mut flash, at)?)
                && latest.is_none_or(|(_, other)| record.sequence > other.sequence)
            {
                latest = Some((at, record));
            }
        }
        let (next, sequence, floor) = match latest {
            Some((at, record)) => (at + RECORD_BYTES, record.sequence, record.floor),
            None => (region.start, 0, Cost::ZERO),
        };
        Ok(Self { flash, region, reserve, next, sequence, floor })
    }

    /// What the log leaves of the budget: a floor below kappa while an episode
    /// runs, and after a reset all that may still be incurred.
    pub const fn remaining(&self) -> Cost {
        self.floor
    }

    /// Starts an episode with a budget of `kappa`. Until this returns, the
    /// episode before has not ended.
    ///
    /// # Errors
    /// [`JournalError::Flash`]
    pub fn begin(&mut self, kappa: Cost) -> Result<(), JournalError<F::Error>> {
        self.append(BEGIN, self.below(kappa))
    }

    /// To be called with the kappa of every step before its action is taken:
    /// writes a record where the floor does not cover the action.
    ///
    /// # Errors
    /// [`JournalError::Flash`]; the action must not be taken then.
    pub fn cover(&mut self, kappa: Cost) -> Result<(), JournalError<F::Error>> {
        if self.floor <= kappa.saturating_sub(self.reserve.step) {
            return Ok(());
        }
        self.append(LOWER, self.below(kappa))
    }

    /// Gives the flash back.
    pub fn into_flash(self) -> F {
        self.flash
    }

    /// The floor that a record at `kappa` sets.
    const fn below(&self, kappa: Cost) -> Cost {
        kappa.saturating_sub(self.reserve.step).saturating_sub(self.reserve.ahead)
    }

    fn append(&mut self, kind: u32, floor: Cost) -> Result<(), JournalError<F::Error>> {
        let record = Record { sequence: self.sequence.saturating_add(1), floor, kind };
        self.find_room()?;
        let at = self.next;
        // The place is used up whether or not the record gets through.
        self.next = at + RECORD_BYTES;
        self.sequence = record.sequence;
        self.flash.write(at, &record.bytes()).map_err(JournalError::Flash)?;
        self.floor = floor;
        Ok(())
    }

    /// Moves on to an erased place, over what a power cut left, and erases the
    /// block of the oldest records where the one before it is full.
    fn find_room(&mut self) -> Result<(), JournalError<F::Error>> {
        let block = F::ERASE_SIZE as u32;
        while !self.next.is_multiple_of(block) {
            if read(&mut self.flash, self.next)? == [0xFF; RECORD_BYTES as usize] {
                return Ok(());
            }
            self.next += RECORD_BYTES;
        }
        if self.next >= self.region.end {
            self.next = self.region.start;
        }
        self.flash.erase(self.next, self.next + block).map_err(JournalError::Flash)
    }
}

fn read<F: NorFlash>(flash: &mut F, at: u32) -> Result<[u8; RECORD_BYTES as usize], JournalError<F::Error>> {
    let mut bytes = [0; RECORD_BYTES as usize];
    flash.read(at, &mut bytes).map_err(JournalError::Flash)?;
    Ok(bytes)
}
