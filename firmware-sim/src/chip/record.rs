//! The boot record: which slot boots.
//!
//! Magic `ARMC`, version, length and CRC-32 of the record, each 4 bytes and
//! little-endian, then the record, encoded by postcard.

use crc::{CRC_32_ISO_HDLC, Crc};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Slot;

const MAGIC: [u8; 4] = *b"ARMC";
const VERSION: u32 = 1;
const HEADER_BYTES: usize = 16;
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// What the chip keeps between boots.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct BootRecord {
    /// The slot that boots.
    pub(super) active: Option<Slot>,
}

/// Why there is no boot record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum RecordError {
    /// The bytes do not start with `ARMC`.
    #[error("not a chip file; make one with firmware-sim flash")]
    Magic,
    /// Another version wrote it.
    #[error("chip file version {0}, but this program reads version {VERSION}; flash a new chip")]
    Version(u32),
    /// The record is cut short, or its checksum is wrong.
    #[error("the boot record is damaged; flash a new chip")]
    Damaged,
}

impl BootRecord {
    pub(super) fn read(bytes: &[u8]) -> Result<Self, RecordError> {
        let (header, rest) = bytes.split_first_chunk::<HEADER_BYTES>().ok_or(RecordError::Magic)?;
        let ([magic, version, length, checksum], _) = header.as_chunks::<4>() else {
            return Err(RecordError::Magic);
        };
        if *magic != MAGIC {
            return Err(RecordError::Magic);
        }
        match u32::from_le_bytes(*version) {
            VERSION => {}
            other => return Err(RecordError::Version(other)),
        }
        let record = rest.get(..u32::from_le_bytes(*length) as usize).ok_or(RecordError::Damaged)?;
        if CRC.checksum(record) != u32::from_le_bytes(*checksum) {
            return Err(RecordError::Damaged);
        }
        postcard::from_bytes(record).map_err(|_| RecordError::Damaged)
    }

    /// Writes the record into the front of its sector.
    pub(super) fn write(&self, sector: &mut [u8]) {
        // `Some` and a slot: two bytes at most.
        let mut buffer = [0; 8];
        let record: &[u8] = postcard::to_slice(self, &mut buffer).map_or(&[], |record| record);
        let words = [u32::from_le_bytes(MAGIC), VERSION, record.len() as u32, CRC.checksum(record)];
        let bytes = words.into_iter().flat_map(u32::to_le_bytes).chain(record.iter().copied());
        for (out, byte) in sector.iter_mut().zip(bytes) {
            *out = byte;
        }
    }
}
