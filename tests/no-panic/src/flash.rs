//! Flash in RAM, for the budget's journal.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

const BYTES: usize = 8192;

pub struct Flash([u8; BYTES]);

#[derive(Debug)]
pub struct OutOfBounds;

impl NorFlashError for OutOfBounds {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::OutOfBounds
    }
}

impl Flash {
    pub const fn erased() -> Self {
        Self([0xFF; BYTES])
    }

    fn at(&mut self, offset: u32, length: usize) -> Result<&mut [u8], OutOfBounds> {
        self.0.get_mut(offset as usize..).and_then(|rest| rest.get_mut(..length)).ok_or(OutOfBounds)
    }
}

impl ErrorType for Flash {
    type Error = OutOfBounds;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), OutOfBounds> {
        let found = self.at(offset, bytes.len())?;
        for (out, byte) in bytes.iter_mut().zip(found) {
            *out = *byte;
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 4096;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), OutOfBounds> {
        self.at(from, to.saturating_sub(from) as usize)?.fill(0xFF);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), OutOfBounds> {
        for (out, byte) in self.at(offset, bytes.len())?.iter_mut().zip(bytes) {
            *out &= byte;
        }
        Ok(())
    }
}
