//! Bytes of the fuzzer, taken from the front as what a target needs, and bytes where an image may lie.

use armor_core::image::SECTION_ALIGNMENT;

/// What is left of the bytes; zeros follow.
pub(crate) struct Input<'a>(pub(crate) &'a [u8]);

impl<'a> Input<'a> {
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(crate) fn array<const N: usize>(&mut self) -> [u8; N] {
        let mut array = [0; N];
        let bytes = self.slice(N);
        array[..bytes.len()].copy_from_slice(bytes);
        array
    }

    pub(crate) fn byte(&mut self) -> u8 {
        u8::from_le_bytes(self.array())
    }

    pub(crate) fn half(&mut self) -> u16 {
        u16::from_le_bytes(self.array())
    }

    pub(crate) fn word(&mut self) -> u32 {
        u32::from_le_bytes(self.array())
    }

    pub(crate) fn float(&mut self) -> f32 {
        f32::from_le_bytes(self.array())
    }

    /// At most `length` bytes.
    pub(crate) fn slice(&mut self, length: usize) -> &'a [u8] {
        let (front, rest) = self.0.split_at(length.min(self.0.len()));
        self.0 = rest;
        front
    }
}

/// Bytes on a boundary that suits an image.
pub(crate) struct Aligned {
    memory: Vec<u8>,
    start: usize,
}

impl Aligned {
    pub(crate) fn as_slice(&self) -> &[u8] {
        &self.memory[self.start..]
    }

    pub(crate) fn as_mut_slice(&mut self) -> &mut [u8] {
        &mut self.memory[self.start..]
    }
}

impl From<&[u8]> for Aligned {
    fn from(bytes: &[u8]) -> Self {
        let mut memory = vec![0; bytes.len() + SECTION_ALIGNMENT - 1];
        let start = memory.as_ptr().align_offset(SECTION_ALIGNMENT);
        memory.truncate(start + bytes.len());
        memory[start..].copy_from_slice(bytes);
        Self { memory, start }
    }
}
