//! Images: any bytes, any bytes with right checksums, and good images with a few wrong bytes and right checksums.

use std::sync::OnceLock;

use armor_core::image::{HEADER_BYTES, MAGIC, PolicyImage, Precision, SectionKind, VERSION};
use armor_core::schedule::Sampler;
use armor_core::shape::Shape;
use armor_core::units::CostLimit;
use armor_infer::golden;
use crc::{CRC_32_ISO_HDLC, Crc};

use crate::fixture::{Fixture, Parts, SMALL};
use crate::input::{Aligned, Input};

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
/// Widths that no vector divides.
const ODD: Shape = Shape { state: 5, action: 3, hidden: 37, kappa_hidden: 9, kappa_embedding: 11, steps: 7 };
/// Capacities of the controllers here: the odd network fits, and much that the fuzzer makes does not.
pub(crate) const STATE: usize = 16;
pub(crate) const ACTION: usize = 8;
pub(crate) const HIDDEN: usize = 64;

/// Whatever the bytes are, they are an error with a name or an image whose every accessor works.
pub fn run(data: &[u8]) {
    let mut input = Input(data);
    let memory = match input.byte() % 3 {
        0 => Aligned::from(input.0),
        1 => sealed(input.0),
        _ => edited(&mut input, usize::MAX),
    };
    let Ok(image) = PolicyImage::new_checked(memory.as_slice()) else { return };
    for kind in SectionKind::ALL {
        std::hint::black_box(image.words(kind));
    }
    for row in image.sections().golden.rows() {
        std::hint::black_box(row);
    }
    // A trace that differs is an error, and none of them a panic.
    let _ = golden::replay::<STATE, ACTION, HIDDEN>(&image);
}

/// A good image with at most `edits` bytes changed, each by three bytes of the input.
pub(crate) fn edited(input: &mut Input<'_>, edits: usize) -> Aligned {
    let images = images();
    let mut bytes = images[usize::from(input.byte()) % images.len()].clone();
    for _ in 0..edits {
        if input.is_empty() {
            break;
        }
        let (at, value) = (usize::from(input.half()), input.byte());
        let length = bytes.len();
        bytes[at % length] = value;
    }
    sealed(&bytes)
}

/// The bytes with a header that fits them; the manifest's length is theirs.
fn sealed(bytes: &[u8]) -> Aligned {
    let mut memory = Aligned::from(bytes);
    if let Some((header, payload)) = memory.as_mut_slice().split_first_chunk_mut::<HEADER_BYTES>() {
        header[..4].copy_from_slice(&MAGIC);
        header[4..6].copy_from_slice(&VERSION.to_le_bytes());
        header[12..16].copy_from_slice(&(bytes.len() as u32).to_le_bytes());
        header[16..20].copy_from_slice(&CRC.checksum(payload).to_le_bytes());
        let own = CRC.checksum(&header[..28]);
        header[28..].copy_from_slice(&own.to_le_bytes());
    }
    memory
}

/// Good images in every precision and layout, with several chains, a golden trace and a budget map.
pub(crate) fn images() -> &'static [Vec<u8>] {
    static IMAGES: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    IMAGES.get_or_init(|| {
        let mut images = Vec::new();
        for shape in [SMALL, ODD] {
            for precision in [Precision::F32, Precision::Int16x8, Precision::Int8] {
                let mut parts = match precision {
                    Precision::F32 => Fixture::random(shape, 1),
                    integers => Fixture::integers(shape, integers, 1),
                };
                parts.set_rungs(&[(Sampler::Ddpm, shape.steps), (Sampler::Ddim, 3), (Sampler::Ddim, 1)]);
                let limit = CostLimit::new(5.0).expect("5 is a limit");
                if shape == SMALL {
                    parts.record_golden(limit, 3, &[[0.5, -1.0, 2.0]; 2], &[0.0, 1.0]);
                } else {
                    let knot = |budget: u32, condition: f32| [budget << 16, condition.to_bits()];
                    *parts.section(SectionKind::BudgetMap) = [knot(0, 1.0), knot(8, 4.0), knot(40, 5.0)].concat();
                }
                let mut push = |parts: Parts| images.push(parts.build().image().bytes().to_vec());
                push(parts.clone());
                if precision != Precision::F32 {
                    push(parts.paired());
                }
            }
        }
        images
    })
}
