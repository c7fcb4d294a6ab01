//! The 32 bytes in front: magic, version, lengths, checksums.

use crc::{CRC_32_ISO_HDLC, Crc, Table};

use super::ImageError;

/// The first four bytes of an image.
pub const MAGIC: [u8; 4] = *b"ARMR";
/// The format version that this code reads and writes.
pub const VERSION: u16 = 1;
/// Length of the header.
pub const HEADER_BYTES: usize = 32;
/// Alignment of the image in memory.
pub const ALIGNMENT: usize = 16;
/// Alignment of each section in the image: a cache line, so that where the image is aligned like that as well, no
/// vector of weights lies across two.
pub const SECTION_ALIGNMENT: usize = 64;

/// Length of the header up to its own checksum.
const CHECKED_BYTES: usize = 28;

const CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// Length of a manifest with its padding; none where it is too long for any image.
pub(super) fn padded_manifest(length: usize) -> Option<usize> {
    HEADER_BYTES.checked_add(length)?.checked_next_multiple_of(SECTION_ALIGNMENT)?.checked_sub(HEADER_BYTES)
}

/// CRC-32 as in Ethernet and zip.
pub(super) fn checksum(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// What the header says, lengths in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) manifest_length: usize,
    pub(super) total_length: usize,
    pub(super) payload_checksum: u32,
}

impl Header {
    pub(super) fn read(bytes: &[u8]) -> Result<Self, ImageError> {
        let header: &[u8; HEADER_BYTES] =
            bytes.first_chunk().ok_or(ImageError::Truncated { expected: HEADER_BYTES, actual: bytes.len() })?;
        if !bytes.as_ptr().addr().is_multiple_of(ALIGNMENT) {
            return Err(ImageError::Misaligned);
        }
        let [m0, m1, m2, m3, v0, v1, rest @ ..] = header;
        if [*m0, *m1, *m2, *m3] != MAGIC {
            return Err(ImageError::Magic);
        }
        let version = u16::from_le_bytes([*v0, *v1]);
        if version != VERSION {
            return Err(ImageError::Version(version));
        }
        let [_r0, _r1, l0, l1, l2, l3, t0, t1, t2, t3, p0, p1, p2, p3, _reserved @ .., c0, c1, c2, c3] = rest;
        let (checked, _) = header.split_at(CHECKED_BYTES);
        if checksum(checked) != u32::from_le_bytes([*c0, *c1, *c2, *c3]) {
            return Err(ImageError::Header);
        }
        Ok(Self {
            manifest_length: u32::from_le_bytes([*l0, *l1, *l2, *l3]) as usize,
            total_length: u32::from_le_bytes([*t0, *t1, *t2, *t3]) as usize,
            payload_checksum: u32::from_le_bytes([*p0, *p1, *p2, *p3]),
        })
    }

    pub(super) fn write(&self) -> [u8; HEADER_BYTES] {
        let fields = [
            u32::from_le_bytes(MAGIC),
            u32::from(VERSION),
            self.manifest_length as u32,
            self.total_length as u32,
            self.payload_checksum,
        ];
        let mut header = [0; HEADER_BYTES];
        for (out, field) in header.chunks_exact_mut(4).zip(fields) {
            out.copy_from_slice(&field.to_le_bytes());
        }
        let (checked, own) = header.split_at_mut(CHECKED_BYTES);
        own.copy_from_slice(&checksum(checked).to_le_bytes());
        header
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_crc_32() {
        assert_eq!(checksum(b"123456789"), 0xCBF4_3926);
    }
}
