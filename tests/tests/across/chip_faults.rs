//! A cut or damaged chip is an error with a name, and never boots a policy that was not flashed.

use std::fs::{self, File};
use std::io::{Seek, SeekFrom, Write};
use std::ops::Range;

use armor_core::image::{HEADER_BYTES, ImageError};
use armor_core::noise::below;
use firmware_sim::chip::{BootError, Chip, ChipError, FLASH_BYTES, Slot, SlotFault};
use firmware_sim::host::Unfit;
use firmware_sim::memory::AlignedBytes;

use crate::fixture::Run;
use crate::image_faults::{draws, exported, renamed};

/// A chip file that holds an older policy in slot A and the exported one, which boots, in slot B.
struct ChipFile {
    run: Run,
    older: AlignedBytes,
    newer: AlignedBytes,
    /// Where in the file each slot's image lies.
    images: [Range<usize>; 2],
}

/// Bytes of the boot record: magic, version, length, checksum, which slot.
const RECORD_BYTES: usize = 18;

impl ChipFile {
    fn new() -> Self {
        let newer = exported();
        let older = renamed(&newer, "ball-ran");
        let mut chip = Chip::blank();
        for (image, slot) in [(&older, Slot::A), (&newer, Slot::B)] {
            assert_eq!(chip.flash(image.as_slice(), None).unwrap().slot, slot);
        }
        let run = Run::new();
        chip.write(&run.path("robot.chip")).unwrap();
        let flash = fs::read(run.path("robot.chip")).unwrap();
        let images = [&older, &newer].map(|image| {
            let image = image.as_slice();
            let start = flash.windows(image.len()).position(|bytes| bytes == image).unwrap();
            start..start + image.len()
        });
        Self { run, older, newer, images }
    }

    fn read(&self) -> Result<Chip, ChipError> {
        Chip::read(&self.run.path("robot.chip"))
    }

    /// Changes a byte of the file in place.
    fn set(&self, at: usize, value: u8) {
        let mut file = File::options().write(true).open(self.run.path("robot.chip")).unwrap();
        file.seek(SeekFrom::Start(at as u64)).unwrap();
        file.write_all(&[value]).unwrap();
    }
}

#[test]
fn a_cut_chip_file_is_named() {
    let chip = ChipFile::new();
    let path = chip.run.path("robot.chip");
    let whole = fs::read(&path).unwrap();
    let sampled = draws(2).take(100).map(|[word, _]| below(word, FLASH_BYTES as u32) as usize);
    for length in (0..64).chain(sampled).chain([FLASH_BYTES - 1]) {
        fs::write(&path, &whole[..length]).unwrap();
        let error = chip.read().unwrap_err();
        // Without the whole record it may be any file; with it, the size tells.
        let is_named = match error {
            ChipError::Record { .. } => length < RECORD_BYTES,
            ChipError::Size { actual, .. } => actual == length && length >= RECORD_BYTES,
            ChipError::File(_) => false,
        };
        assert!(is_named, "{length}: {error}");
    }
}

/// Whatever bit flips: the newer policy boots bit for bit, or it is passed
/// over by name for the older one bit for bit, or the chip is refused by name.
#[test]
fn a_flipped_bit_on_a_chip_never_boots_a_policy_that_was_not_flashed() {
    let chip = ChipFile::new();
    let whole = fs::read(chip.run.path("robot.chip")).unwrap();
    let [older, newer] = chip.images.clone();
    // The record and what follows it, either image, and the whole flash, most of it erased.
    let regions = [0..2 * RECORD_BYTES, older, newer.clone(), 0..FLASH_BYTES];
    let [mut refused, mut passed_over] = [0; 2];
    for (index, [word, shape]) in draws(3).take(800).enumerate() {
        let region = regions[index % regions.len()].clone();
        let at = region.start + below(word, region.len() as u32) as usize;
        chip.set(at, whole[at] ^ (1 << (shape % 8)));
        let in_newer = newer.contains(&at);
        match chip.read() {
            Err(error) => {
                assert!(at < RECORD_BYTES && matches!(error, ChipError::Record { .. }), "byte {at}: {error}");
                refused += 1;
            }
            Ok(read) => {
                let boot = read.boot().unwrap();
                let expected = if in_newer { (Slot::A, &chip.older) } else { (Slot::B, &chip.newer) };
                assert_eq!((boot.slot, &boot.image), expected, "byte {at}");
                assert_eq!(boot.passed_over.is_some(), in_newer, "byte {at}");
                if let Some(fault) = boot.passed_over {
                    assert!(matches!(fault, SlotFault::Unfit(Unfit::Image(_))), "byte {at}: {fault}");
                    passed_over += 1;
                }
            }
        }
        chip.set(at, whole[at]);
    }
    assert!(refused > 20 && passed_over > 150, "{refused} refused, {passed_over} passed over");
}

#[test]
fn a_chip_with_two_damaged_slots_does_not_boot() {
    let chip = ChipFile::new();
    for (range, image) in chip.images.iter().zip([&chip.older, &chip.newer]) {
        chip.set(range.start + HEADER_BYTES, !image.as_slice()[HEADER_BYTES]);
    }
    let fault = SlotFault::Unfit(Unfit::Image(ImageError::Checksum));
    let expected = BootError::NoGoodSlot { active: Slot::B, active_fault: fault, other_fault: fault };
    assert_eq!(chip.read().unwrap().boot(), Err(expected));
}
