//! Bytes at an address that is a multiple of 16, as images want them.

use std::path::Path;

use crate::file::{self, FileError};

/// Bytes of any number, the first at a multiple of 16.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AlignedBytes {
    words: Vec<u128>,
    length: usize,
}

impl AlignedBytes {
    /// Bytes of a value, such as the 0xFF of erased flash.
    pub fn filled(byte: u8, length: usize) -> Self {
        Self { words: vec![u128::from_ne_bytes([byte; 16]); length.div_ceil(16)], length }
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
        let bytes: &[u8] = bytemuck::cast_slice(&self.words);
        &bytes[..self.length]
    }

    /// The bytes, to be changed.
    pub fn as_mut_slice(&mut self) -> &mut [u8] {
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut self.words);
        &mut bytes[..self.length]
    }
}

impl From<&[u8]> for AlignedBytes {
    fn from(bytes: &[u8]) -> Self {
        let mut aligned = Self::filled(0, bytes.len());
        aligned.as_mut_slice().copy_from_slice(bytes);
        aligned
    }
}

// A `u128` is the memory; where it were less aligned, every image would be refused.
const _: () = assert!(align_of::<u128>() >= armor_core::image::ALIGNMENT);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_of_any_number_are_kept_and_aligned() {
        for length in [0, 1, 15, 16, 17, 4096] {
            let bytes: Vec<u8> = (0..length).map(|i| i as u8).collect();
            let aligned = AlignedBytes::from(bytes.as_slice());
            assert_eq!(aligned.as_slice(), bytes);
            assert!(aligned.as_slice().as_ptr().addr().is_multiple_of(16));
            assert_eq!(AlignedBytes::filled(0xFF, length).as_slice(), vec![0xFF; length]);
        }
    }
}
