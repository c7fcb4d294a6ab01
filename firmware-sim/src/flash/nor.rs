//! A model of NOR flash behind the traits of `embedded-storage`.
//!
//! What power cuts leave is drawn from a seed: of a word that was being
//! written, any of its bits may be cleared already, and of a block that was
//! being erased, any may still be as it was. Words and blocks before are whole,
//! those after untouched.

use armor_core::noise::Noise;
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};
use thiserror::Error;

use crate::memory::AlignedBytes;

/// Bytes of an erase block, a small one of external NOR flash.
pub const ERASE_BYTES: usize = 4096;
/// Bytes that are written at once, a word.
pub const WRITE_BYTES: usize = 4;
/// What erased flash reads.
const ERASED: u8 = 0xFF;

/// A flash and its wear.
#[derive(Clone, Debug, PartialEq)]
pub struct NorModel {
    bytes: AlignedBytes,
    /// Erases of each block.
    wear: Vec<u32>,
    /// Words written and blocks erased so far.
    operations: u64,
    power: Power,
}

/// Whether there is power, and for how long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Power {
    On,
    /// It ends within the operation of this number; the seed says what that leaves.
    CutAt {
        operation: u64,
        seed: u64,
    },
    Off,
}

/// Why a flash did not do as it was told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum FlashFault {
    /// The power is gone.
    #[error("power was cut")]
    PowerCut,
    /// A bit would have to rise without an erase.
    #[error("the place is not erased")]
    NotErased,
    /// The place or the length is no whole number of units.
    #[error("the place or the length is not aligned")]
    NotAligned,
    /// The place lies beyond the flash.
    #[error("the place lies beyond the flash")]
    OutOfBounds,
}

impl NorFlashError for FlashFault {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::PowerCut | Self::NotErased => NorFlashErrorKind::Other,
            Self::NotAligned => NorFlashErrorKind::NotAligned,
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
        }
    }
}

impl From<NorFlashErrorKind> for FlashFault {
    fn from(kind: NorFlashErrorKind) -> Self {
        match kind {
            NorFlashErrorKind::NotAligned => Self::NotAligned,
            _ => Self::OutOfBounds,
        }
    }
}

impl NorModel {
    /// Erased flash of `blocks` blocks, never worn.
    pub fn erased(blocks: usize) -> Self {
        Self {
            bytes: AlignedBytes::filled(ERASED, blocks * ERASE_BYTES),
            wear: vec![0; blocks],
            operations: 0,
            power: Power::On,
        }
    }

    /// Flash that holds `bytes`, whole blocks, each erased as often as `wear`
    /// says; nothing where the two do not fit together.
    pub fn restored(bytes: AlignedBytes, wear: Vec<u32>) -> Option<Self> {
        let fits = bytes.as_slice().len() == wear.len() * ERASE_BYTES;
        fits.then_some(Self { bytes, wear, operations: 0, power: Power::On })
    }

    /// What it holds.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.as_slice()
    }

    /// Erases of each block.
    pub fn wear(&self) -> &[u32] {
        &self.wear
    }

    /// Words written and blocks erased so far.
    pub const fn operations(&self) -> u64 {
        self.operations
    }

    /// Cuts the power within the operation after `operations` more; the seed
    /// says what that leaves. Until [`NorModel::restore_power`], all fails.
    pub const fn cut_power_after(&mut self, operations: u64, seed: u64) {
        self.power = Power::CutAt { operation: self.operations + operations, seed };
    }

    /// Brings the power back, for good.
    pub const fn restore_power(&mut self) {
        self.power = Power::On;
    }

    /// Flips a bit, as time and radiation do.
    pub fn flip(&mut self, bit: usize) {
        if let Some(byte) = self.bytes.as_mut_slice().get_mut(bit / 8) {
            *byte ^= 1 << (bit % 8);
        }
    }

    /// Does one operation on `range`: `after` says what each byte becomes.
    fn operate(&mut self, range: std::ops::Range<usize>, after: impl Fn(usize, u8) -> u8) -> Result<(), FlashFault> {
        let cut = match self.power {
            Power::Off => return Err(FlashFault::PowerCut),
            Power::CutAt { operation, seed } if operation <= self.operations => Some(seed),
            Power::CutAt { .. } | Power::On => None,
        };
        let noise = cut.map(Noise::new);
        for (index, byte) in self.bytes.as_mut_slice()[range].iter_mut().enumerate() {
            let (before, after) = (*byte, after(index, *byte));
            // Where power was cut, a random half of the bits has changed.
            let changed = noise.map_or(0xFF, |noise| noise.words(0, 0, index as u32)[0] as u8);
            *byte = (before & !changed) | (after & changed);
        }
        self.operations += 1;
        if cut.is_some() {
            self.power = Power::Off;
            return Err(FlashFault::PowerCut);
        }
        Ok(())
    }
}

impl ErrorType for NorModel {
    type Error = FlashFault;
}

impl ReadNorFlash for NorModel {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashFault> {
        check_read(self, offset, bytes.len())?;
        if self.power == Power::Off {
            return Err(FlashFault::PowerCut);
        }
        bytes.copy_from_slice(&self.bytes.as_slice()[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.as_slice().len()
    }
}

impl NorFlash for NorModel {
    const WRITE_SIZE: usize = WRITE_BYTES;
    const ERASE_SIZE: usize = ERASE_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashFault> {
        check_erase(self, from, to)?;
        for block in from as usize / ERASE_BYTES..to as usize / ERASE_BYTES {
            self.wear[block] += 1;
            self.operate(block * ERASE_BYTES..(block + 1) * ERASE_BYTES, |_, _| ERASED)?;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashFault> {
        check_write(self, offset, bytes.len())?;
        for (index, word) in bytes.chunks(WRITE_BYTES).enumerate() {
            let at = offset as usize + index * WRITE_BYTES;
            let range = at..at + word.len();
            if self.bytes.as_slice()[range.clone()].iter().zip(word).any(|(old, new)| old & new != *new) {
                return Err(FlashFault::NotErased);
            }
            self.operate(range, |index, _| word[index])?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn bits_fall_by_words_and_rise_by_blocks() {
        let mut flash = NorModel::erased(2);
        flash.write(4, &[0x0F, 0xF0, 0x00, 0xFF]).unwrap();
        assert_eq!(flash.bytes()[..10], [255, 255, 255, 255, 0x0F, 0xF0, 0x00, 0xFF, 255, 255]);
        // Bits may fall further without an erase, and never rise.
        flash.write(4, &[0x0E, 0xF0, 0x00, 0xFF]).unwrap();
        assert_eq!(flash.write(4, &[0x0F, 0xF0, 0x00, 0xFF]), Err(FlashFault::NotErased));
        assert_eq!(flash.bytes()[4], 0x0E);
        flash.erase(0, ERASE_BYTES as u32).unwrap();
        assert!(flash.bytes().iter().all(|&byte| byte == ERASED));
        assert_eq!((flash.wear(), flash.operations()), (&[1, 0][..], 3));
    }

    #[test]
    fn what_is_not_whole_or_not_there_is_refused() {
        let mut flash = NorModel::erased(1);
        assert_eq!(flash.write(2, &[0; 4]), Err(FlashFault::NotAligned));
        assert_eq!(flash.write(0, &[0; 3]), Err(FlashFault::NotAligned));
        assert_eq!(flash.write(4096, &[0; 4]), Err(FlashFault::OutOfBounds));
        assert_eq!(flash.erase(0, 100), Err(FlashFault::NotAligned));
        assert_eq!(flash.read(4090, &mut [0; 7]), Err(FlashFault::OutOfBounds));
        assert_eq!(flash.operations(), 0);
    }

    proptest! {
        /// Words before the cut are whole, that of the cut lies between old
        /// and new, and those after are untouched.
        #[test]
        fn a_cut_leaves_a_word_in_between(words in 1u64..8, seed in any::<u64>(), value in any::<u8>()) {
            let mut flash = NorModel::erased(1);
            flash.cut_power_after(words - 1, seed);
            prop_assert_eq!(flash.write(0, &[value; 64]), Err(FlashFault::PowerCut));
            prop_assert_eq!(flash.read(0, &mut [0]), Err(FlashFault::PowerCut));
            prop_assert_eq!(flash.erase(0, 4096), Err(FlashFault::PowerCut));
            flash.restore_power();
            let cut = (words as usize - 1) * WRITE_BYTES;
            prop_assert!(flash.bytes()[..cut].iter().all(|&byte| byte == value));
            prop_assert!(flash.bytes()[cut..][..WRITE_BYTES].iter().all(|byte| byte & value == value));
            prop_assert!(flash.bytes()[cut + WRITE_BYTES..].iter().all(|&byte| byte == ERASED));
        }
    }
}
