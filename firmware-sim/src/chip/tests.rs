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
        chip.boot().unwrap();
        chip.confirm().unwrap();
    }
    chip
}

/// What boots, and nothing else.
fn booted(chip: &mut Chip) -> (Slot, AlignedBytes) {
    let boot = chip.boot().unwrap();
    (boot.slot, boot.image)
}

/// Flips one bit of the image in a slot.
fn damage(chip: &mut Chip, slot: Slot) {
    chip.flash.flip(8 * (slot.start() + HEADER_BYTES + 5));
}

#[test]
fn what_was_flashed_boots_bit_for_bit_after_the_file_was_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.chip");
    let mut chip = Chip::blank();
    let report = chip.flash(image(1).as_slice(), None).unwrap();
    assert_eq!(report, Flashed { slot: Slot::A, image_bytes: image(1).as_slice().len(), golden_rows: GOLDEN_ROWS });
    chip.write(&path).unwrap();
    assert_eq!(fs::metadata(&path).unwrap().len(), FILE_BYTES as u64);
    let boot = Chip::read(&path).unwrap().boot().unwrap();
    let expected = Boot { slot: Slot::A, image: image(1), golden_rows: GOLDEN_ROWS, on_trial: true, passed_over: None };
    assert_eq!(boot, expected);
}

#[test]
fn an_update_goes_to_the_slot_without_a_confirmed_policy() {
    let mut chip = flashed(&[1]);
    assert_eq!(chip.flash(image(2).as_slice(), None).unwrap().slot, Slot::B);
    // Not yet confirmed, it is what the next update replaces.
    assert_eq!(chip.flash(image(3).as_slice(), None).unwrap().slot, Slot::B);
    assert_eq!(booted(&mut chip), (Slot::B, image(3)));
    chip.confirm().unwrap();
    let refused = chip.flash(image(4).as_slice(), Some(Slot::B));
    assert_eq!(refused, Err(FlashError::Confirmed { slot: Slot::B }));
    assert_eq!(chip.flash(image(4).as_slice(), Some(Slot::A)).unwrap().slot, Slot::A);
    assert_eq!(booted(&mut chip), (Slot::A, image(4)));
}

#[test]
fn a_trial_that_is_not_confirmed_is_rolled_back_and_the_reason_stays() {
    let mut chip = flashed(&[1]);
    chip.flash(image(2).as_slice(), None).unwrap();
    let trial = chip.boot().unwrap();
    assert_eq!((trial.slot, trial.on_trial, trial.passed_over), (Slot::B, true, None));
    // A reset before it was confirmed.
    for fault in [SlotFault::NotConfirmed, SlotFault::RolledBack(Reason::NotConfirmed)] {
        let boot = chip.boot().unwrap();
        assert_eq!((boot.slot, boot.image, boot.on_trial), (Slot::A, image(1), false));
        assert_eq!(boot.passed_over, Some(fault));
    }
    assert_eq!(chip.flash(image(3).as_slice(), None).unwrap().slot, Slot::B);
    assert_eq!(booted(&mut chip), (Slot::B, image(3)));
}

#[test]
fn a_trial_with_nothing_to_go_back_to_is_repeated() {
    let mut chip = Chip::blank();
    chip.flash(image(1).as_slice(), None).unwrap();
    for _ in 0..3 {
        let boot = chip.boot().unwrap();
        assert_eq!((boot.slot, boot.image, boot.on_trial), (Slot::A, image(1), true));
    }
    chip.confirm().unwrap();
    assert!(!chip.boot().unwrap().on_trial);
}

#[test]
fn an_image_for_another_task_is_refused() {
    let mut chip = flashed(&[1]);
    let other = AlignedBytes::from(Parts::random("ball-circle", BALL_RUN, 2).with_golden().bytes().as_slice());
    let refused = chip.flash(other.as_slice(), None).unwrap_err().to_string();
    assert!(refused.contains("the chip flies ball-run and the image is for ball-circle"), "{refused}");
}

/// A `ball-run` image of a release, trained with budgets of up to `trained_max`.
fn release(release: u32, trained_max: u32) -> AlignedBytes {
    let mut parts = Parts::random("ball-run", BALL_RUN, release.into());
    parts.manifest.release = release;
    parts.manifest.kappa.trained_max = Cost::from_raw(trained_max << 16);
    AlignedBytes::from(parts.with_golden().bytes().as_slice())
}

#[test]
fn a_downgrade_is_refused_against_the_confirmed_policy_alone() {
    let mut chip = Chip::blank();
    chip.flash(release(5, 40).as_slice(), None).unwrap();
    // A first policy that nobody confirmed is nothing to go back to.
    chip.flash(release(3, 40).as_slice(), None).unwrap();
    chip.boot().unwrap();
    chip.confirm().unwrap();
    chip.flash(release(9, 40).as_slice(), None).unwrap();
    let before = chip.clone();
    let refused = chip.flash(release(2, 40).as_slice(), None);
    assert_eq!(refused, Err(FlashError::Downgrade { confirmed: 3, image: 2 }));
    assert_eq!(chip, before);
    // Release 9 is on trial only, and the confirmed one may be flashed again.
    chip.flash(release(3, 40).as_slice(), None).unwrap();
    assert_eq!(booted(&mut chip).1, release(3, 40));
}

#[test]
fn an_image_for_smaller_budgets_or_another_robot_is_refused() {
    let mut chip = flashed(&[1]);
    let [confirmed, image] = [40, 39].map(|units| Cost::from_raw(units << 16));
    let refused = chip.flash(release(1, 39).as_slice(), None);
    assert_eq!(refused, Err(FlashError::KappaRange { confirmed, image }));
    chip.flash(release(1, 41).as_slice(), None).unwrap();

    let shape = Shape { state: 8, ..BALL_RUN };
    let other = AlignedBytes::from(Parts::random("ball-run", shape, 2).with_golden().bytes().as_slice());
    let refused = chip.flash(other.as_slice(), None);
    assert_eq!(refused, Err(FlashError::WrongRobot { flown: [7, 2], image: [8, 2] }));
}

/// Power is cut at every write and erase of an update over an older image, and
/// of the boots after it. Whatever is cut, the next boot flies the old policy
/// or the new one, bit for bit; and a second try of the update gets through.
#[test]
fn an_update_survives_a_power_cut_at_every_operation() {
    let (old, new) = (image(2), image(3));
    // Slot A holds the oldest policy, which the update erases; B the old one.
    let before = flashed(&[1, 2]);
    let update = |chip: &mut Chip| -> Result<(), Box<dyn std::error::Error>> {
        chip.flash(new.as_slice(), None)?;
        chip.boot()?;
        Ok(chip.confirm()?)
    };
    let mut whole = before.clone();
    update(&mut whole).unwrap();
    let operations = whole.flash.operations() - before.flash.operations();
    assert!(operations > (new.as_slice().len() / WRITE_BYTES) as u64);

    let mut flown = [0; 2];
    for cut in 0..operations {
        let mut chip = before.clone();
        chip.flash.cut_power_after(cut, cut);
        update(&mut chip).unwrap_err();
        // Power fails again at the first operation of the boot, if it has one.
        chip.flash.restore_power();
        chip.flash.cut_power_after(0, !cut);
        let _ = chip.boot();
        chip.flash.restore_power();
        let (_, image) = booted(&mut chip);
        assert!(image == old || image == new, "cut {cut}");
        flown[usize::from(image == new)] += 1;

        update(&mut chip).unwrap();
        assert_eq!(booted(&mut chip).1, new, "cut {cut}");
    }
    println!("{operations} cut points; the old policy flew after {}, the new one after {}", flown[0], flown[1]);
    assert!(flown[0] > 0 && flown[1] > 0);
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
    let header = |error: &ChipError| match error {
        ChipError::Header { error, .. } => Some(*error),
        _ => None,
    };
    assert_eq!(header(&read(b"")), Some(HeaderError::Magic));
    assert_eq!(header(&read(image(1).as_slice())), Some(HeaderError::Magic));
    for length in [17, super::header::HEADER_BYTES, FILE_BYTES - 1] {
        let error = read(&good[..length]);
        let damaged = header(&error) == Some(HeaderError::Damaged);
        assert!(damaged || matches!(error, ChipError::Size { actual, .. } if actual == length), "{error}");
    }
    assert!(matches!(read(&[good.as_slice(), &[0xFF]].concat()), ChipError::Size { .. }));
    assert!(matches!(Chip::read(&folder.path().join("none.chip")), Err(ChipError::File(_))));
}
