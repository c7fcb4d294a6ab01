//! The policy image, version 1: what the trainer exports and the controller
//! flies. `docs/image-format.md` is the normative byte layout.
//!
//! Header, manifest (postcard), then sections at 64-byte alignment that are
//! read in place. Bytes are checked once, in [`PolicyImage::new_checked`];
//! after `Ok` no accessor fails, allocates or copies.

mod critic;
mod error;
#[cfg(test)]
mod fixture;
mod golden;
mod header;
mod layout;
mod manifest;
mod network;
mod reader;
mod sections;
mod writer;

pub use critic::{Critic, CriticHead, MAX_CRITIC_WIDTH};
pub use error::ImageError;
pub use golden::{GoldenRow, GoldenTrace};
pub use header::{ALIGNMENT, HEADER_BYTES, MAGIC, SECTION_ALIGNMENT, VERSION};
pub use layout::Layout;
pub use manifest::{
    KappaRange, MAX_RUNGS, Manifest, Precision, Provenance, Quality, Rung, SECTION_COUNT, Section, SectionKind,
};
pub use network::{FloatNetwork, IntegerNetwork, LevelScales, Network, Rows};
pub use sections::{Dense, Sections};
pub use writer::{WriteError, write};

use header::Header;

/// A policy image whose every byte has been checked.
#[derive(Clone, Debug)]
pub struct PolicyImage<'a> {
    bytes: &'a [u8],
    /// What follows the padded manifest.
    body: &'a [u8],
    manifest: Manifest<'a>,
    sections: Sections<'a>,
    critic: Option<Critic<'a>>,
}

impl<'a> PolicyImage<'a> {
    /// Checks `bytes` and reads them in place. What follows the image, such as
    /// the erased rest of a flash slot, is ignored.
    ///
    /// # Errors
    /// An [`ImageError`] that names the first fault: any flipped bit, any
    /// truncation, any content that the format does not allow.
    pub fn new_checked(bytes: &'a [u8]) -> Result<Self, ImageError> {
        let header = Header::read(bytes)?;
        let bytes = bytes
            .get(..header.total_length)
            .ok_or(ImageError::Truncated { expected: header.total_length, actual: bytes.len() })?;
        let payload = bytes.get(HEADER_BYTES..).ok_or(ImageError::Header)?;
        if header::checksum(payload) != header.payload_checksum {
            return Err(ImageError::Checksum);
        }
        let padded_length = header::padded_manifest(header.manifest_length).ok_or(ImageError::Header)?;
        let (manifest_bytes, body) = payload.split_at_checked(padded_length).ok_or(ImageError::Header)?;
        let manifest = Manifest::read(manifest_bytes, header.manifest_length)?;
        let (sections, critic) = Sections::read(&manifest, body)?;
        Ok(Self { bytes, body, manifest, sections, critic })
    }

    /// The exact bytes of the image, without what follows it.
    pub const fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    /// What the image says of itself.
    pub const fn manifest(&self) -> &Manifest<'a> {
        &self.manifest
    }

    /// The words of a section as they stand in the image.
    pub fn words(&self, kind: SectionKind) -> &'a [u32] {
        let section = self.manifest.sections.iter().find(|section| section.kind == kind);
        let bytes = section.and_then(|section| {
            let (offset, length) = (section.offset as usize, section.length as usize);
            self.body.get(offset..)?.get(..length)
        });
        bytes.and_then(|bytes| bytemuck::try_cast_slice(bytes).ok()).unwrap_or_default()
    }

    /// The numbers, in place.
    pub const fn sections(&self) -> &Sections<'a> {
        &self.sections
    }

    /// The critic, where the image has one.
    pub const fn critic(&self) -> Option<&Critic<'a>> {
        self.critic.as_ref()
    }
}

#[cfg(test)]
mod tests;
