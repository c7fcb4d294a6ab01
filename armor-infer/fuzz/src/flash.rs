//! A small flash whose power may be cut within any word that is written and any block that is erased.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

const ERASE_BYTES: usize = 256;
const WRITE_BYTES: usize = 4;
/// Four blocks of 16 records each.
pub(crate) const BYTES: usize = 4 * ERASE_BYTES;

#[derive(Debug)]
pub(crate) struct Flash {
    pub(crate) bytes: [u8; BYTES],
    /// After how many more operations power is cut, and which bits have changed then.
    pub(crate) cut: Option<(u32, u32)>,
}

#[derive(Debug, PartialEq)]
pub(crate) struct PowerCut;

impl Flash {
    pub(crate) const fn erased() -> Self {
        Self { bytes: [0xFF; BYTES], cut: None }
    }

    /// Makes `after` of the bytes from `at` on.
    fn operate(&mut self, at: usize, after: &[u8]) -> Result<(), PowerCut> {
        let (left, changed) = self.cut.unwrap_or((1, u32::MAX));
        let is_cut = left == 0;
        let changed = if is_cut { changed.to_le_bytes() } else { [0xFF; 4] };
        for ((byte, after), changed) in self.bytes[at..].iter_mut().zip(after).zip(changed.iter().cycle()) {
            *byte = (*byte & !changed) | (after & changed);
        }
        self.cut = self.cut.map(|(left, changed)| (left.saturating_sub(1), changed));
        if is_cut { Err(PowerCut) } else { Ok(()) }
    }
}

impl NorFlashError for PowerCut {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl ErrorType for Flash {
    type Error = PowerCut;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), PowerCut> {
        bytes.copy_from_slice(&self.bytes[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = WRITE_BYTES;
    const ERASE_SIZE: usize = ERASE_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), PowerCut> {
        (from..to).step_by(ERASE_BYTES).try_for_each(|at| self.operate(at as usize, &[0xFF; ERASE_BYTES]))
    }

    /// Panics where a bit would have to rise without an erase: nothing may ask for that.
    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), PowerCut> {
        for (at, word) in (offset as usize..).step_by(WRITE_BYTES).zip(bytes.chunks(WRITE_BYTES)) {
            assert!(self.bytes[at..].iter().zip(word).all(|(old, new)| old & new == *new), "{at} is not erased");
            self.operate(at, word)?;
        }
        Ok(())
    }
}
