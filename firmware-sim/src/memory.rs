//! Bytes at an address that is a multiple of 64, as images want them.

use std::path::Path;

use armor_core::image::SECTION_ALIGNMENT;

use crate::file::{self, FileError};

/// Bytes of any number, the first at a multiple of 64.
#[derive(Debug)]
pub struct AlignedBytes {
    memory: Vec<u8>,
    start: usize,
    length: usize,
}

impl AlignedBytes {
    /// Bytes of a value, such as the 0xFF of erased flash.
    pub fn filled(byte: u8, length: usize) -> Self {
        let memory = vec![byte; length + SECTION_ALIGNMENT - 1];
        let start = memory.as_ptr().align_offset(SECTION_ALIGNMENT);
        Self { memory, start, length }
    }

    /// A file's bytes.
    ///
    /// # Errors
    /// [`FileError`]
    pub fn read(path: &Path) -> Result<Self, FileError> {
        file::read(path).map(|bytes| Self::from(bytes.as_slice()))
    }

    /// The bytes.
    pub fn as_slice(&self) -> &[u8] {
        &self.memory[self.start..][..self.length]
    }

    /// The bytes, to be changed.
    pub fn as_mut_slice(&mut self) -> &mut [u8] {
        &mut self.memory[self.start..][..self.length]
    }
}

impl From<&[u8]> for AlignedBytes {
    fn from(bytes: &[u8]) -> Self {
        let mut aligned = Self::filled(0, bytes.len());
        aligned.as_mut_slice().copy_from_slice(bytes);
        aligned
    }
}

impl Clone for AlignedBytes {
    fn clone(&self) -> Self {
        // Other memory has another first multiple.
        Self::from(self.as_slice())
    }
}

impl PartialEq for AlignedBytes {
    fn eq(&self, other: &Self) -> bool {
        self.as_slice() == other.as_slice()
    }
}

impl Eq for AlignedBytes {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_of_any_number_are_kept_and_aligned() {
        for length in [0, 1, 63, 64, 65, 4096] {
            let bytes: Vec<u8> = (0..length).map(|i| i as u8).collect();
            let aligned = AlignedBytes::from(bytes.as_slice());
            assert_eq!(aligned.as_slice(), bytes);
            assert_eq!(aligned.clone().as_slice(), bytes);
            assert!(aligned.clone().as_slice().as_ptr().addr().is_multiple_of(SECTION_ALIGNMENT));
            assert!(aligned.as_slice().as_ptr().addr().is_multiple_of(SECTION_ALIGNMENT));
            assert_eq!(AlignedBytes::filled(0xFF, length).as_slice(), vec![0xFF; length]);
        }
    }
}
