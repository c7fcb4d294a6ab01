//! The front of a chip file: what it is, and how worn its flash.
//!
//! Magic `ARMC`, version, length and CRC-32 of the wear, each 4 bytes and
//! little-endian, then the erases of each block, encoded by postcard. The flash
//! follows at [`HEADER_BYTES`].

use crc::{CRC_32_ISO_HDLC, Crc};
use thiserror::Error;

const MAGIC: [u8; 4] = *b"ARMC";
const VERSION: u32 = 2;
const PREFIX_BYTES: usize = 16;
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
/// Bytes before the flash.
pub(super) const HEADER_BYTES: usize = 4096;

/// Why a file is no chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum HeaderError {
    /// The bytes do not start with `ARMC`.
    #[error("not a chip file; make one with firmware-sim flash")]
    Magic,
    /// Another version wrote it.
    #[error("chip file version {0}, but this program reads version {VERSION}; flash a new chip")]
    Version(u32),
    /// The header is cut short, or its checksum is wrong.
    #[error("the chip file's header is damaged; flash a new chip")]
    Damaged,
}

/// The erases of each block that a file's header holds.
pub(super) fn read(bytes: &[u8]) -> Result<Vec<u32>, HeaderError> {
    let (prefix, rest) = bytes.split_first_chunk::<PREFIX_BYTES>().ok_or(HeaderError::Magic)?;
    let ([magic, version, length, checksum], _) = prefix.as_chunks::<4>() else {
        return Err(HeaderError::Magic);
    };
    if *magic != MAGIC {
        return Err(HeaderError::Magic);
    }
    match u32::from_le_bytes(*version) {
        VERSION => {}
        other => return Err(HeaderError::Version(other)),
    }
    let wear = rest.get(..u32::from_le_bytes(*length) as usize).ok_or(HeaderError::Damaged)?;
    if CRC.checksum(wear) != u32::from_le_bytes(*checksum) {
        return Err(HeaderError::Damaged);
    }
    postcard::from_bytes(wear).map_err(|_| HeaderError::Damaged)
}

/// The header of a flash so worn.
pub(super) fn bytes(wear: &[u32]) -> Vec<u8> {
    // A block's number takes five bytes at most, so that 512 of them fit.
    let wear = postcard::to_stdvec(wear).unwrap_or_default();
    let words = [u32::from_le_bytes(MAGIC), VERSION, wear.len() as u32, CRC.checksum(&wear)];
    let mut bytes: Vec<u8> = words.into_iter().flat_map(u32::to_le_bytes).chain(wear).collect();
    bytes.resize(HEADER_BYTES, 0xFF);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wear_is_read_back_and_no_flipped_bit_or_cut_goes_unseen() {
        let wear: Vec<u32> = (0..512).map(|block| block * block * 1000).collect();
        let good = bytes(&wear);
        assert_eq!(good.len(), HEADER_BYTES);
        assert_eq!(read(&good), Ok(wear.clone()));
        let length = PREFIX_BYTES + postcard::to_stdvec(&wear).unwrap().len();
        for bit in 0..8 * length {
            let mut flipped = good.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(read(&flipped).is_err(), "bit {bit}");
        }
        for cut in 0..length {
            assert!(read(&good[..cut]).is_err(), "cut at {cut}");
        }
    }
}
