//! Policy images for tests: well formed, and broken in one place.

use super::header::{Header, checksum, padded_manifest};
use super::*;
use crate::schedule::{Sampler, Schedule};
use crate::shape::Shape;
use crate::units::Cost;
use std::vec;
use std::vec::Vec;

/// Dimensions that all differ, so that no two sections can be taken for each other.
pub(super) const SHAPE: Shape = Shape { state: 3, action: 2, hidden: 5, kappa_hidden: 4, kappa_embedding: 6, steps: 7 };
/// The smallest image, for tests over all its bytes.
pub(super) const TINY: Shape = Shape { state: 1, action: 1, hidden: 1, kappa_hidden: 1, kappa_embedding: 1, steps: 1 };

/// Bytes on a 16-byte boundary.
pub(super) struct Aligned(pub(super) Vec<u128>);

impl Aligned {
    pub(super) fn zeros(bytes: usize) -> Self {
        Self(vec![0; bytes.div_ceil(16)])
    }

    pub(super) fn bytes(&mut self) -> &mut [u8] {
        bytemuck::cast_slice_mut(&mut self.0)
    }
}

/// What an image is written from.
#[derive(Clone)]
pub(super) struct Parts {
    pub(super) manifest: Manifest<'static>,
    pub(super) contents: Vec<Vec<u32>>,
}

impl Parts {
    /// Every word is its own number, except where the format says more.
    pub(super) fn new(shape: Shape) -> Self {
        let schedule = Schedule::vp(shape.steps.into());
        let rungs = [Rung { sampler: Sampler::Ddpm, steps: shape.steps }, Rung { sampler: Sampler::Ddim, steps: 1 }];
        let quality = Quality {
            rung: 1,
            limit: Cost::from_raw(99),
            candidates: 1,
            episodes: 20,
            reward_normalized: 0.25,
            cost_normalized: 0.5,
        };
        let manifest = Manifest {
            task: "ball-run",
            release: 7,
            shape,
            precision: Precision::F32,
            layout: Layout::Rows,
            kappa: KappaRange { scale: 0.05, trained_max: Cost::from_raw(80 << 16) },
            schedule,
            rungs: rungs.into_iter().collect(),
            provenance: Provenance {
                version: "0.1.0",
                preset: "paper",
                seed: u64::MAX,
                steps: 200_000,
                data_sha256: [1; 32],
                config_sha256: [2; 32],
            },
            agreement_max_abs: 1e-6,
            quality: core::iter::once(quality).collect(),
            sections: Default::default(),
        };
        let [s, a, h, k, e, n] =
            [shape.state, shape.action, shape.hidden, shape.kappa_hidden, shape.kappa_embedding, shape.steps]
                .map(usize::from);
        let lengths = [
            2 * s,
            3 * a,
            2 * k,
            (k + 1) * k,
            (k + 1) * e,
            (s + e + 1) * h,
            n * h,
            a * h,
            (h + 1) * h,
            (h + 1) * h,
            (h + 1) * a,
        ];
        let mut contents: Vec<Vec<u32>> = (1..)
            .zip(lengths)
            .map(|(section, length)| (0..length as u32).map(|i| word(section, i)).collect())
            .collect();
        contents[SectionKind::ActionBounds as usize] =
            [vec![(-1.0f32).to_bits(); a], vec![1.0f32.to_bits(); a], vec![0; a]].concat();
        contents.push(Vec::new());
        let steps = rungs.iter().flat_map(|rung| schedule.chain(rung.sampler, rung.steps.into()));
        contents.push(steps.flat_map(|step| step.to_f32().to_words()).collect());
        let row = (0..GoldenTrace::row_words(s, a) as u32).map(|i| word(14, i));
        contents.push([7, 8, 5 << 16, 1].into_iter().chain(row).collect());
        contents.push(Vec::new());
        contents.push(Vec::new());
        Self { manifest, contents }
    }

    /// The same in integers: every byte of a matrix is its own number.
    pub(super) fn integers(shape: Shape) -> Self {
        let mut parts = Self::new(shape);
        parts.manifest.precision = Precision::Int8;
        let [s, a, h, e, n] =
            [shape.state, shape.action, shape.hidden, shape.kappa_embedding, shape.steps].map(usize::from);
        let matrix = |count: usize| (0..count.div_ceil(4) as u32).map(|i| 0x0403_0201u32.wrapping_mul(i + 1));
        let rows = |inputs: usize| matrix(h * inputs).chain(1..=h as u32).collect::<Vec<u32>>();
        let bias = || (0..h as u32).map(|o| 10u32.wrapping_sub(o)).collect::<Vec<u32>>();
        let level = |n: u32| [n, n + 1, n + 2, n + 3, n + 4, 0.5f32.to_bits()];
        for (kind, words) in [
            (SectionKind::Context, [rows(s), rows(e), bias()].concat()),
            (SectionKind::TimeTable, matrix(2 * n * h).collect()),
            (SectionKind::ActionInput, matrix(2 * a * h).collect()),
            (SectionKind::Hidden2, [rows(h), bias()].concat()),
            (SectionKind::Hidden3, [rows(h), bias()].concat()),
            (SectionKind::Output, matrix(2 * a * h).chain((0..2 * a as u32).map(|i| word(9, i))).collect()),
            (
                SectionKind::Scales,
                [[1.5f32, 2.5, 3.5].map(f32::to_bits).to_vec(), vec![1, 9], (1..=n as u32).flat_map(level).collect()]
                    .concat(),
            ),
        ] {
            *parts.section(kind) = words;
        }
        parts
    }

    pub(super) fn section(&mut self, kind: SectionKind) -> &mut Vec<u32> {
        &mut self.contents[kind as usize]
    }

    pub(super) fn write_into(&self, out: &mut [u8]) -> Result<usize, WriteError> {
        write(&self.manifest, &core::array::from_fn(|i| self.contents[i].as_slice()), out)
    }

    /// The image and its length.
    pub(super) fn build(&self) -> (Aligned, usize) {
        let mut memory = Aligned::zeros(4096);
        let length = self.write_into(memory.bytes()).unwrap();
        (memory, length)
    }

    /// Why these parts make no image.
    #[track_caller]
    pub(super) fn fault(&self) -> ImageError {
        self.fault_within(4096)
    }

    /// The same, for parts that take up to `room` bytes.
    #[track_caller]
    pub(super) fn fault_within(&self, room: usize) -> ImageError {
        match self.write_into(Aligned::zeros(room).bytes()) {
            Err(WriteError::Invalid(error)) => error,
            other => panic!("{other:?}"),
        }
    }
}

/// The `i`-th word of a section: a float that no other place holds.
pub(super) fn word(section: u32, i: u32) -> u32 {
    (section as f32 + i as f32 / 1024.0).to_bits()
}

pub(super) fn words(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// An image with valid checksums around any manifest bytes and body.
pub(super) fn seal(manifest: &[u8], padding: u8, body: &[u8], manifest_length: usize) -> Result<(), ImageError> {
    let padded = [manifest, &vec![padding; padded_manifest(manifest.len()).unwrap() - manifest.len()]].concat();
    let payload = [&padded, body].concat();
    let total_length = HEADER_BYTES + payload.len();
    let header = Header { manifest_length, total_length, payload_checksum: checksum(&payload) };
    let mut memory = Aligned::zeros(total_length);
    memory.bytes()[..total_length].copy_from_slice(&[&header.write()[..], &payload].concat());
    PolicyImage::new_checked(memory.bytes()).map(drop)
}

/// Seals the parts again, with a manifest that `edit` has changed.
pub(super) fn resealed(edit: impl FnOnce(&mut Manifest<'_>)) -> Result<(), ImageError> {
    let (mut memory, _) = Parts::new(SHAPE).build();
    let image = PolicyImage::new_checked(memory.bytes()).unwrap();
    let mut manifest = image.manifest().clone();
    let mut buffer = [0; 1024];
    let body = HEADER_BYTES + padded_manifest(postcard::to_slice(&manifest, &mut buffer).unwrap().len()).unwrap();
    edit(&mut manifest);
    let encoded = postcard::to_slice(&manifest, &mut buffer).unwrap();
    seal(encoded, 0, &image.bytes()[body..], encoded.len())
}
