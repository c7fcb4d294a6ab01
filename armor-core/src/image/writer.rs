//! Writes an image into the caller's memory.

use core::fmt;

use super::header::{self, Header};
use super::manifest::{Manifest, SECTION_COUNT, Section, SectionKind};
use super::{HEADER_BYTES, ImageError, PolicyImage, SECTION_ALIGNMENT};

/// Why an image could not be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WriteError {
    /// The buffer is too small, or the manifest too long for it.
    Full,
    /// What was written does not pass the reader's own checks.
    Invalid(ImageError),
}

impl fmt::Display for WriteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Full => f.write_str("the buffer is too small for the image"),
            Self::Invalid(error) => write!(f, "the image would be invalid: {error}"),
        }
    }
}

impl core::error::Error for WriteError {}

/// Writes an image into `out` and returns its length in bytes.
///
/// `contents` holds the words of each section in the order of
/// [`SectionKind::ALL`], an optional one that has none is left out; the manifest's section table is made here, whatever
/// it was. `out` must start on a 16-byte boundary, for what was written is
/// read back with every check.
///
/// # Errors
/// [`WriteError`]
pub fn write(manifest: &Manifest<'_>, contents: &[&[u32]; SECTION_COUNT], out: &mut [u8]) -> Result<usize, WriteError> {
    let mut manifest = manifest.clone();
    manifest.sections.clear();
    let mut end = 0usize;
    let present = || {
        let all = SectionKind::ALL.into_iter().zip(contents);
        all.filter(|(kind, words)| !(kind.is_optional() && words.is_empty()))
    };
    for (kind, words) in present() {
        let offset = end.next_multiple_of(SECTION_ALIGNMENT);
        let section = Section { kind, offset: offset as u32, length: 4 * words.len() as u32 };
        manifest.sections.push(section).map_err(|_| WriteError::Full)?;
        end = offset + 4 * words.len();
    }

    out.fill(0);
    let (header_out, payload) = out.split_at_mut_checked(HEADER_BYTES).ok_or(WriteError::Full)?;
    let manifest_length = postcard::to_slice(&manifest, payload).map_err(|_| WriteError::Full)?.len();
    let manifest_padded = header::padded_manifest(manifest_length).ok_or(WriteError::Full)?;
    let payload = payload.get_mut(..manifest_padded + end).ok_or(WriteError::Full)?;
    let (_, body) = payload.split_at_mut_checked(manifest_padded).ok_or(WriteError::Full)?;
    for (section, (_, words)) in manifest.sections.iter().zip(present()) {
        let bytes = body.get_mut(section.offset as usize..).unwrap_or_default();
        for (out, word) in bytes.chunks_exact_mut(4).zip(*words) {
            out.copy_from_slice(&word.to_le_bytes());
        }
    }
    let header = Header {
        manifest_length,
        total_length: HEADER_BYTES + payload.len(),
        payload_checksum: header::checksum(payload),
    };
    header_out.copy_from_slice(&header.write());

    PolicyImage::new_checked(out).map_err(WriteError::Invalid)?;
    Ok(header.total_length)
}
