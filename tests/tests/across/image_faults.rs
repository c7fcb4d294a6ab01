//! A damaged or foreign image is an error with a name: on the image that was
//! exported from a trained policy, not on one made up for a test.

use armor_core::image::{HEADER_BYTES, ImageError, Manifest, PolicyImage, SECTION_COUNT, write};
use armor_core::noise::{Noise, below};
use armor_core::units::CostLimit;
use armor_infer::{Controller, LoadError, Policy};
use armor_train::data::{Dataset, Recording};
use armor_train::export::export;
use firmware_sim::flight::{FlightError, FlightPlan, fly};
use firmware_sim::memory::AlignedBytes;
use firmware_sim::task::Task;

use crate::fixture::{LIMIT, Run, config, policy};

/// Places drawn at random, of each kind of damage.
const SAMPLES: u64 = 3000;

pub(crate) fn exported() -> AlignedBytes {
    policy().exported.bytes.clone()
}

/// Length of header and manifest with its padding; the sections follow.
fn front(bytes: &[u8]) -> usize {
    let image = PolicyImage::new_checked(bytes).unwrap();
    let sections = image.manifest().sections.last().map(|last| (last.offset + last.length) as usize).unwrap();
    bytes.len() - sections
}

/// Places of one kind of damage: a word to place it, a word to shape it.
pub(crate) fn draws(kind: u32) -> impl Iterator<Item = [u32; 2]> {
    (0..SAMPLES).map(move |index| {
        let [place, shape, ..] = Noise::new(5).words(kind, index, 0);
        [place, shape]
    })
}

#[test]
fn every_bit_of_header_and_manifest_is_guarded() {
    let mut bytes = exported();
    let front = front(bytes.as_slice());
    // 32 bytes of header, then a manifest that at least holds two SHA-256 and 14 sections.
    assert!(front > HEADER_BYTES + 2 * 32 + 14 * 3 && front.is_multiple_of(16), "{front}");
    for bit in 0..8 * front {
        let (at, mask) = (bit / 8, 1 << (bit % 8));
        bytes.as_mut_slice()[at] ^= mask;
        let found = PolicyImage::new_checked(bytes.as_slice()).map(drop);
        let expected = match at {
            0..4 => ImageError::Magic,
            4..6 => ImageError::Version(u16::from_le_bytes([bytes.as_slice()[4], bytes.as_slice()[5]])),
            6..HEADER_BYTES => ImageError::Header,
            _ => ImageError::Checksum,
        };
        assert_eq!(found, Err(expected), "byte {at}, bit {mask:#04x}");
        bytes.as_mut_slice()[at] ^= mask;
    }
    assert!(PolicyImage::new_checked(bytes.as_slice()).is_ok());
}

#[test]
fn every_cut_in_header_and_manifest_is_named() {
    let bytes = exported();
    let bytes = bytes.as_slice();
    for actual in 0..=front(bytes) {
        let expected = if actual < HEADER_BYTES { HEADER_BYTES } else { bytes.len() };
        let found = PolicyImage::new_checked(&bytes[..actual]).map(drop);
        assert_eq!(found, Err(ImageError::Truncated { expected, actual }));
    }
}

#[test]
fn damage_anywhere_in_the_sections_is_named() {
    let mut bytes = exported();
    let (front, length) = (front(bytes.as_slice()), bytes.as_slice().len());
    let place = |word: u32| front + below(word, (length - front) as u32) as usize;
    for [word, shape] in draws(0) {
        let (at, mask) = (place(word), 1 + below(shape, 255) as u8);
        bytes.as_mut_slice()[at] ^= mask;
        let found = PolicyImage::new_checked(bytes.as_slice()).map(drop);
        assert_eq!(found, Err(ImageError::Checksum), "byte {at}, mask {mask:#04x}");
        bytes.as_mut_slice()[at] ^= mask;
    }
    for [word, _] in draws(1) {
        let actual = place(word);
        let found = PolicyImage::new_checked(&bytes.as_slice()[..actual]).map(drop);
        assert_eq!(found, Err(ImageError::Truncated { expected: length, actual }));
    }
    assert!(PolicyImage::new_checked(bytes.as_slice()).is_ok());
}

#[test]
fn an_image_that_is_not_aligned_is_refused() {
    let image = exported();
    let length = image.as_slice().len();
    let mut memory = AlignedBytes::filled(0, length + 16);
    for shift in 0..=16 {
        memory.as_mut_slice()[shift..shift + length].copy_from_slice(image.as_slice());
        let found = PolicyImage::new_checked(&memory.as_slice()[shift..]).map(drop);
        let expected = if shift % 16 == 0 { Ok(()) } else { Err(ImageError::Misaligned) };
        assert_eq!(found, expected, "shifted by {shift}");
    }
}

/// An image exported for a robot of three state entries, and the same under the name of `ball-run`.
fn of_another_size() -> [AlignedBytes; 2] {
    let rows = 8;
    let recording = Recording {
        state_dim: 3,
        action_dim: 2,
        observations: (0..3 * rows).map(|entry| entry as f32 / 24.0).collect(),
        next_observations: (3..3 * (rows + 1)).map(|entry| entry as f32 / 24.0).collect(),
        actions: vec![0.5; 2 * rows],
        rewards: vec![1.0; rows],
        costs: vec![1.0; rows],
        terminals: (1..=rows).map(|row| row == rows).collect(),
        timeouts: vec![false; rows],
        sha256: [4; 32],
    };
    let data = Dataset::new(recording).unwrap();
    let mut config = config(&["steps=1"]);
    config.task = "three-legs".to_owned();
    let run = Run::new();
    run.fit(&config, &data, None);
    let bytes = export(&run.checkpoint(), &data, None).unwrap().bytes;
    let renamed = sealed_anew(&bytes, |manifest| manifest.task = "ball-run");
    [bytes, renamed]
}

/// The image with a changed manifest, sealed anew.
pub(crate) fn sealed_anew(bytes: &AlignedBytes, change: impl FnOnce(&mut Manifest<'_>)) -> AlignedBytes {
    let image = PolicyImage::new_checked(bytes.as_slice()).unwrap();
    let body = &bytes.as_slice()[front(bytes.as_slice())..];
    let sections: Vec<Vec<u32>> = image
        .manifest()
        .sections
        .iter()
        .map(|section| {
            let bytes = &body[section.offset as usize..][..section.length as usize];
            bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word)).collect()
        })
        .collect();
    let contents: [&[u32]; SECTION_COUNT] =
        std::array::from_fn(|index| sections.get(index).map_or(&[][..], Vec::as_slice));
    let mut manifest = image.manifest().clone();
    change(&mut manifest);
    let mut out = AlignedBytes::filled(0, bytes.as_slice().len() + 16);
    let length = write(&manifest, &contents, out.as_mut_slice()).unwrap();
    AlignedBytes::from(&out.as_slice()[..length])
}

#[test]
fn an_image_for_another_state_size_is_refused_by_flight_and_controller() {
    let task = Task::named("ball-run").unwrap();
    let limit = CostLimit::new(LIMIT).unwrap();
    let plan = FlightPlan { task, limit, episodes: 1, seed: 0, rate_hz: task.rate_hz, max_steps: usize::MAX };
    let [own, renamed] = of_another_size();
    let refused = |bytes: &AlignedBytes| fly(&PolicyImage::new_checked(bytes.as_slice()).unwrap(), &plan).unwrap_err();
    assert_eq!(refused(&own), FlightError::WrongTask { image: "three-legs".into(), task: "ball-run" });
    let sizes = FlightError::WrongSize { task: "ball-run", state: 3, action: 2, expected_state: 7, expected_action: 2 };
    assert_eq!(refused(&renamed), sizes);
    let message = sizes.to_string();
    assert!(message.starts_with("the image senses 3 and moves 2 entries, ball-run has 7 and 2"), "{message}");

    // A controller built for that robot, with too little room for a ball.
    let image = PolicyImage::new_checked(policy().exported.bytes.as_slice()).unwrap();
    let policy = Policy::load(&image).unwrap();
    let found = Controller::<3, 2, 12>::new(policy, limit, 0).map(drop);
    assert_eq!(found, Err(LoadError::StateCapacity { needed: 7, capacity: 3 }));
}
