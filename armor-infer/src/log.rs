//! A log of small records in flash that no power cut can falsify.
//!
//! ```text
//! record    sequence, two words, CRC-32 of these: 16 bytes, little-endian
//! ```
//!
//! Records fill the erase blocks of a region one after the other, round and
//! round. The valid one with the highest sequence counts; one that power was
//! cut in is invalid and does not. A block is erased before the last record of
//! the one before it is written, so that the record that counts is never in it,
//! and what follows that record is erased, unless something was written there.

use core::ops::Range;

use crc::{CRC_32_ISO_HDLC, Crc};
use embedded_storage::nor_flash::NorFlash;

/// Bytes of a record; a flash must write and read in units that divide it.
pub const RECORD_BYTES: u32 = 16;
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
const ERASED: [u8; RECORD_BYTES as usize] = [0xFF; RECORD_BYTES as usize];

/// A log in a region of a flash.
#[derive(Debug)]
pub struct Log<F> {
    flash: F,
    region: Range<u32>,
    /// Where the next record goes.
    next: u32,
    /// Where the record that counts lies; the region's start where there is none.
    latest_at: u32,
    sequence: u32,
    latest: Option<[u32; 2]>,
    /// Places after the latest record that hold no record and are not erased.
    unreadable: u32,
}

/// Why a log cannot be kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogError<E> {
    /// The region is not of at least two whole erase blocks within the flash,
    /// or the flash writes or reads in units that do not divide a record.
    Region,
    /// The flash failed.
    Flash(E),
}

impl<E: core::fmt::Debug> core::fmt::Display for LogError<E> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Region => f.write_str("a log needs two or more whole erase blocks, and a flash that writes 16 bytes"),
            Self::Flash(error) => write!(f, "the flash failed ({error:?})"),
        }
    }
}

impl<E: core::fmt::Debug> core::error::Error for LogError<E> {}

impl<F: NorFlash> Log<F> {
    /// Finds the log in `region`, in bytes of the flash.
    ///
    /// # Errors
    /// [`LogError`]
    pub fn open(mut flash: F, region: Range<u32>) -> Result<Self, LogError<F::Error>> {
        let block = F::ERASE_SIZE as u32;
        let divides = |unit: usize| unit != 0 && (RECORD_BYTES as usize).is_multiple_of(unit);
        let is_whole = block != 0
            && block.is_multiple_of(RECORD_BYTES)
            && region.start.is_multiple_of(block)
            && region.end.is_multiple_of(block)
            && region.end.saturating_sub(region.start) >= 2 * block
            && region.end as usize <= flash.capacity();
        if !is_whole || !divides(F::WRITE_SIZE) || !divides(F::READ_SIZE) {
            return Err(LogError::Region);
        }
        let (mut next, mut latest_at, mut sequence, mut latest) = (region.start, region.start, 0, None);
        for at in region.clone().step_by(RECORD_BYTES as usize) {
            if let Some((other, words)) = decode(&read(&mut flash, at)?)
                && (latest.is_none() || other > sequence)
            {
                (next, latest_at, sequence, latest) = (at + RECORD_BYTES, at, other, Some(words));
            }
        }
        let mut unreadable = 0;
        if latest.is_some() {
            // These stay until a newer record is whole, for they tell that there may have been one.
            (unreadable, next) = unreadable_from(&mut flash, &region, next)?;
        }
        let mut log = Self { flash, region, next, latest_at, sequence, latest, unreadable };
        log.pass_over_remains()?;
        Ok(log)
    }

    /// How many places after the record that counts held no record when the log
    /// was opened, and were not erased: what power was cut in, and records that
    /// have decayed since.
    pub const fn unreadable(&self) -> u32 {
        self.unreadable
    }

    /// The words of the record that counts, if there is one.
    pub const fn latest(&self) -> Option<[u32; 2]> {
        self.latest
    }

    /// Writes a record, which counts as soon as it is whole.
    ///
    /// # Errors
    /// [`LogError::Flash`]; the record before still counts then.
    pub fn append(&mut self, words: [u32; 2]) -> Result<(), LogError<F::Error>> {
        let sequence = self.sequence.saturating_add(1);
        self.find_room()?;
        let at = self.next;
        // The place is used up whether or not the record gets through.
        self.next = at + RECORD_BYTES;
        self.sequence = sequence;
        self.flash.write(at, &encode(sequence, words)).map_err(LogError::Flash)?;
        (self.latest, self.latest_at) = (Some(words), at);
        Ok(())
    }

    /// Gives the flash back.
    pub fn into_flash(self) -> F {
        self.flash
    }

    /// Moves on to the next block where this one is not erased from its first
    /// erased place on: records in between would be followed by what is none.
    fn pass_over_remains(&mut self) -> Result<(), LogError<F::Error>> {
        let block = F::ERASE_SIZE as u32;
        let mut at = self.next;
        let mut is_erased = false;
        while !at.is_multiple_of(block) {
            let place = read(&mut self.flash, at)? == ERASED;
            at += RECORD_BYTES;
            if is_erased && !place {
                self.next = at.next_multiple_of(block);
                return Ok(());
            }
            is_erased |= place;
        }
        Ok(())
    }

    /// Moves on to an erased place, over what a power cut left, to the next
    /// block where this one is full; and erases the block after the last place
    /// of one.
    fn find_room(&mut self) -> Result<(), LogError<F::Error>> {
        let block = F::ERASE_SIZE as u32;
        while !self.next.is_multiple_of(block) && read(&mut self.flash, self.next)? != ERASED {
            self.next += RECORD_BYTES;
        }
        if self.next.is_multiple_of(block) {
            self.next = self.around(self.next);
            self.clear(self.next)?;
        }
        let after = self.next + RECORD_BYTES;
        let start = self.next - self.next % block;
        let counts_here = self.latest.is_some() && (start..after).contains(&self.latest_at);
        if after.is_multiple_of(block) && counts_here { self.clear(self.around(after)) } else { Ok(()) }
    }

    /// A place, or the region's start where it is the region's end.
    const fn around(&self, at: u32) -> u32 {
        if at < self.region.end { at } else { self.region.start }
    }

    /// Erases the block that starts at `start`, unless it is erased.
    fn clear(&mut self, start: u32) -> Result<(), LogError<F::Error>> {
        let end = start + F::ERASE_SIZE as u32;
        for at in (start..end).step_by(RECORD_BYTES as usize) {
            if read(&mut self.flash, at)? != ERASED {
                return self.flash.erase(start, end).map_err(LogError::Flash);
            }
        }
        Ok(())
    }
}

/// How many places from `at` on, round the region, are neither erased nor a
/// whole record; and the place after them.
fn unreadable_from<F: NorFlash>(flash: &mut F, region: &Range<u32>, at: u32) -> Result<(u32, u32), LogError<F::Error>> {
    let (mut count, mut after) = (0, at);
    for place in (at..region.end).chain(region.start..at).step_by(RECORD_BYTES as usize) {
        let bytes = read(flash, place)?;
        if bytes == ERASED || decode(&bytes).is_some() {
            break;
        }
        (count, after) = (count + 1, place + RECORD_BYTES);
    }
    Ok((count, after))
}

fn encode(sequence: u32, [first, second]: [u32; 2]) -> [u8; RECORD_BYTES as usize] {
    let mut bytes = ERASED;
    let (body, check) = bytes.split_at_mut(12);
    for (out, byte) in body.iter_mut().zip([sequence, first, second].into_iter().flat_map(u32::to_le_bytes)) {
        *out = byte;
    }
    check.copy_from_slice(&CRC.checksum(body).to_le_bytes());
    bytes
}

/// Sequence and words of a whole record.
fn decode(bytes: &[u8; RECORD_BYTES as usize]) -> Option<(u32, [u32; 2])> {
    let ([sequence, first, second, check], _) = bytes.as_chunks::<4>() else { return None };
    let [sequence, first, second, check] = [sequence, first, second, check].map(|word| u32::from_le_bytes(*word));
    let (body, _) = bytes.split_at(12);
    (CRC.checksum(body) == check).then_some((sequence, [first, second]))
}

fn read<F: NorFlash>(flash: &mut F, at: u32) -> Result<[u8; RECORD_BYTES as usize], LogError<F::Error>> {
    let mut bytes = ERASED;
    flash.read(at, &mut bytes).map_err(LogError::Flash)?;
    Ok(bytes)
}
