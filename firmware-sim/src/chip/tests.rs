use std::fs;

use armor_core::image::{HEADER_BYTES, ImageError, SectionKind};
use armor_core::shape::Shape;
use armor_infer::golden::GoldenError;

use super::*;
use crate::fixture::{self, BALL_RUN, GOLDEN_ROWS, Parts};

fn image(seed: u64) -> AlignedBytes {
    AlignedBytes::from(fixture::ball_run(seed).as_slice())
}

fn flashed(seeds: &[u64]) -> Chip {
    let mut chip = Chip::blank();
    for &seed in seeds {
        chip.flash(image(seed).as_slice(), None).unwrap();
    }
    chip
}

/// Flips one bit of the image in a slot.
fn damage(chip: &mut Chip, slot: Slot) {
    chip.flash.as_mut_slice()[slot.start() + HEADER_BYTES + 5] ^= 1;
}

#[test]
fn what_was_flashed_boots_bit_for_bit_after_the_file_was_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.chip");
    let mut chip = Chip::blank();
    let report = chip.flash(image(1).as_slice(), None).unwrap();
    assert_eq!(report, Flashed { slot: Slot::A, image_bytes: image(1).as_slice().len(), golden_rows: GOLDEN_ROWS });
    chip.write(&path).unwrap();
    assert_eq!(fs::metadata(&path).unwrap().len(), FLASH_BYTES as u64);
    let boot = Chip::read(&path).unwrap().boot().unwrap();
    assert_eq!(boot, Boot { slot: Slot::A, image: image(1), golden_rows: GOLDEN_ROWS, passed_over: None });
}

#[test]
fn flashing_takes_turns_unless_a_slot_is_named() {
    let mut chip = flashed(&[1]);
    assert_eq!(chip.flash(image(2).as_slice(), None).unwrap().slot, Slot::B);
    assert_eq!(chip.boot().unwrap().image, image(2));
    assert_eq!(chip.flash(image(3).as_slice(), Some(Slot::B)).unwrap().slot, Slot::B);
    assert_eq!(chip.boot().unwrap().image, image(3));
    assert_eq!(chip.flash(image(4).as_slice(), None).unwrap().slot, Slot::A);
    assert_eq!(chip.boot().unwrap().image, image(4));
}

#[test]
fn a_damaged_active_slot_gives_way_to_the_other_and_the_reason_is_told() {
    let mut chip = flashed(&[1, 2]);
    damage(&mut chip, Slot::B);
    let boot = chip.boot().unwrap();
    assert_eq!((boot.slot, boot.image), (Slot::A, image(1)));
    assert_eq!(boot.passed_over, Some(SlotFault::Unfit(Unfit::Image(ImageError::Checksum))));
}

#[test]
fn a_chip_without_a_good_slot_does_not_boot() {
    assert_eq!(Chip::blank().boot(), Err(BootError::Blank));
    let mut chip = flashed(&[1]);
    damage(&mut chip, Slot::A);
    let active_fault = SlotFault::Unfit(Unfit::Image(ImageError::Checksum));
    let error = BootError::NoGoodSlot { active: Slot::A, active_fault, other_fault: SlotFault::Empty };
    assert_eq!(chip.boot(), Err(error));
    assert!(error.to_string().starts_with("no slot boots; A: image is damaged"), "{error}");
}

#[test]
fn an_image_that_must_not_fly_is_refused_and_the_chip_stays_as_it_was() {
    let mut chip = flashed(&[1]);
    let before = chip.clone();

    let mut damaged = image(2);
    damaged.as_mut_slice()[HEADER_BYTES + 5] ^= 1;
    let refused = chip.flash(damaged.as_slice(), None);
    assert_eq!(refused, Err(FlashError::Unfit(Unfit::Image(ImageError::Checksum))));

    let mut foreign = Parts::random("ball-run", BALL_RUN, 2).with_golden();
    *foreign.section(SectionKind::Golden).last_mut().unwrap() ^= 1;
    let refused = chip.flash(AlignedBytes::from(foreign.bytes().as_slice()).as_slice(), None);
    assert!(matches!(refused, Err(FlashError::Unfit(Unfit::Golden(GoldenError::Action { .. })))), "{refused:?}");

    let huge = Parts::random("ball-run", Shape { hidden: 512, ..BALL_RUN }, 2).with_golden().bytes();
    assert!(huge.len() > SLOT_BYTES);
    let refused = chip.flash(AlignedBytes::from(huge.as_slice()).as_slice(), None);
    assert_eq!(refused, Err(FlashError::TooLarge { bytes: huge.len() }));

    assert_eq!(chip, before);
}

#[test]
fn what_is_no_chip_file_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.chip");
    flashed(&[1]).write(&path).unwrap();
    let good = fs::read(&path).unwrap();

    let read = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        Chip::read(&path).unwrap_err()
    };
    let record = |error: &ChipError| match error {
        ChipError::Record { error, .. } => Some(*error),
        _ => None,
    };
    assert_eq!(record(&read(b"")), Some(RecordError::Magic));
    assert_eq!(record(&read(image(1).as_slice())), Some(RecordError::Magic));
    for length in [17, SECTOR_BYTES, FLASH_BYTES - 1] {
        let error = read(&good[..length]);
        let damaged = record(&error) == Some(RecordError::Damaged);
        assert!(damaged || matches!(error, ChipError::Size { actual, .. } if actual == length), "{error}");
    }
    assert!(matches!(read(&[good.as_slice(), &[0xFF]].concat()), ChipError::Size { .. }));
    // Magic, version, length, checksum, record: no flipped bit goes unseen.
    for bit in 0..8 * 18 {
        let mut flipped = good.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        assert!(record(&read(&flipped)).is_some(), "bit {bit}");
    }
    assert!(matches!(Chip::read(&folder.path().join("none.chip")), Err(ChipError::File(_))));
}
