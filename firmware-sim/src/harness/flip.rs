//! Weights in RAM that decay.

use armor_core::image::{HEADER_BYTES, PolicyImage, SectionKind};
use armor_core::noise::below;
use crc::{CRC_32_ISO_HDLC, Crc};

use crate::memory::AlignedBytes;

/// An image with one bit of its weights flipped, and its checksums made right:
/// what flies on is what RAM holds, not what was checked.
pub(super) fn flipped(memory: &AlignedBytes, draw: u32) -> AlignedBytes {
    let mut bytes = memory.clone();
    let Ok(image) = PolicyImage::new_checked(memory.as_slice()) else { return bytes };
    let sections = &image.manifest().sections;
    let range = |kind| sections.iter().find(|section| section.kind == kind).map(|s| s.offset..s.offset + s.length);
    let (Some(first), Some(last)) = (range(SectionKind::Kappa1), range(SectionKind::Output)) else { return bytes };
    let end = sections.iter().map(|section| section.offset + section.length).max().unwrap_or(0);
    let body = memory.as_slice().len() - end as usize;
    let bit = body * 8 + (8 * first.start + below(draw, 8 * (last.end - first.start))) as usize;
    let memory = bytes.as_mut_slice();
    memory[bit / 8] ^= 1 << (bit % 8);
    seal(memory);
    bytes
}

/// Makes the checksums of an image right (`docs/image-format.md`, header).
fn seal(image: &mut [u8]) {
    const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
    let payload = CRC.checksum(&image[HEADER_BYTES..]);
    image[16..20].copy_from_slice(&payload.to_le_bytes());
    let header = CRC.checksum(&image[..28]);
    image[28..32].copy_from_slice(&header.to_le_bytes());
}
