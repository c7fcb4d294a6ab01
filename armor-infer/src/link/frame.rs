//! Frames: a message in postcard, its CRC-32, COBS over both, a zero at the end.
//!
//! COBS leaves no zero within a frame, so a receiver that lost its place finds
//! the next frame after the next zero (Cheshire and Baker, "Consistent Overhead
//! Byte Stuffing", 1999).

use core::fmt;

use crc::{CRC_32_ISO_HDLC, Crc, Digest, Table};
use postcard::ser_flavors::Flavor;
use serde::{Deserialize, Serialize};

use super::cobs::{Full, Stuffed, unstuff};

/// Bytes of the checksum behind a message.
pub const CHECKSUM_BYTES: usize = 4;

/// What ends a frame.
const END: u8 = 0;

/// As in a policy image: CRC-32 of Ethernet and zip.
static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// Why bytes are no message, or a message no bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// The bytes are not what was sent: no COBS, too short, or the wrong checksum.
    Damaged,
    /// The bytes are what was sent, and no message of this version.
    Malformed,
    /// The frame does not fit the buffer that it was to be written to.
    Full,
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Damaged => "the frame is damaged; ask again",
            Self::Malformed => "the frame holds no message of this version; compare the versions of both sides",
            Self::Full => "the frame is longer than its buffer; give it more room",
        })
    }
}

impl core::error::Error for FrameError {}

/// The longest frame of a message of at most `message` bytes, its end included.
///
/// A code byte goes before each run of 254 bytes and before what follows, even
/// where nothing does: one more than COBS needs, as postcard writes it.
pub const fn frame_bytes(message: usize) -> usize {
    let content = message + CHECKSUM_BYTES;
    content + content / 254 + 1 + 1
}

/// Writes a message as a frame to the front of `buffer`; returns the frame.
///
/// Not inlined, as [`decode`]: its part of a small stack is not there while a
/// message is answered.
///
/// # Errors
/// [`FrameError::Full`]
#[inline(never)]
pub fn encode<'b>(message: &impl Serialize, buffer: &'b mut [u8]) -> Result<&'b [u8], FrameError> {
    let frame = Checked { frame: Stuffed::new(buffer), digest: CRC.digest() };
    postcard::serialize_with_flavor(message, frame).map(|frame| &*frame).map_err(|_| FrameError::Full)
}

/// A frame in the making: takes the bytes of a message, and ends with its checksum.
struct Checked<'b> {
    frame: Stuffed<'b>,
    digest: Digest<'static, u32, Table<1>>,
}

impl<'b> Flavor for Checked<'b> {
    type Output = &'b mut [u8];

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.digest.update(&[byte]);
        Ok(self.frame.push(byte)?)
    }

    fn finalize(mut self) -> postcard::Result<Self::Output> {
        let checksum = self.digest.finalize().to_le_bytes();
        checksum.into_iter().try_for_each(|byte| self.frame.push(byte))?;
        Ok(self.frame.finish(END)?)
    }
}

impl From<Full> for postcard::Error {
    fn from(_: Full) -> Self {
        Self::SerializeBufferFull
    }
}

/// Reads the message of a frame, with or without the zero at its end; the
/// frame is overwritten by its content.
///
/// Not inlined, so that its part of a small stack is free again before the
/// message is answered.
///
/// # Errors
/// [`FrameError::Damaged`], [`FrameError::Malformed`]
#[inline(never)]
pub fn decode<'f, T: Deserialize<'f>>(frame: &'f mut [u8]) -> Result<T, FrameError> {
    let length = unstuff(frame).ok_or(FrameError::Damaged)?;
    let content = frame.get(..length).ok_or(FrameError::Damaged)?;
    let (message, checksum) = content.split_last_chunk::<CHECKSUM_BYTES>().ok_or(FrameError::Damaged)?;
    if CRC.checksum(message) != u32::from_le_bytes(*checksum) {
        return Err(FrameError::Damaged);
    }
    match postcard::take_from_bytes(message) {
        Ok((message, [])) => Ok(message),
        _ => Err(FrameError::Malformed),
    }
}

/// Finds frames in a stream of bytes; holds at most `N` bytes of one.
#[derive(Clone, Debug)]
pub struct Receiver<const N: usize> {
    bytes: [u8; N],
    /// Bytes of the frame so far; above `N` where it is too long to be kept.
    length: usize,
}

impl<const N: usize> Receiver<N> {
    /// A receiver at the start of a stream.
    pub const fn new() -> Self {
        Self { bytes: [0; N], length: 0 }
    }

    /// Takes the next byte; returns a frame, without its end, where the byte
    /// ends one.
    ///
    /// Empty frames and those of more than `N` bytes are passed over.
    pub fn push(&mut self, byte: u8) -> Option<&mut [u8]> {
        if byte != END {
            if let Some(place) = self.bytes.get_mut(self.length) {
                *place = byte;
            }
            self.length = (self.length + 1).min(N + 1);
            return None;
        }
        let length = core::mem::take(&mut self.length);
        self.bytes.get_mut(..length).filter(|frame| !frame.is_empty())
    }
}

impl<const N: usize> Default for Receiver<N> {
    fn default() -> Self {
        Self::new()
    }
}
