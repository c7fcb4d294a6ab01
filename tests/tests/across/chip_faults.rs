//! A cut or damaged chip is an error with a name, and never boots a policy that was not flashed.

use std::fs::{self, File};
use std::io::{Seek, SeekFrom, Write};
use std::ops::Range;

use armor_core::image::{HEADER_BYTES, ImageError};
use armor_core::noise::below;
use firmware_sim::chip::{BootError, Chip, ChipError, FILE_BYTES, Slot, SlotFault};
use firmware_sim::host::Unfit;
use firmware_sim::memory::AlignedBytes;

use crate::fixture::Run;
use crate::image_faults::{draws, exported, sealed_anew};

/// A chip file that holds an older policy in slot A and the exported one, which boots, in slot B.
struct ChipFile {
    run: Run,
    older: AlignedBytes,
    newer: AlignedBytes,
    /// Where in the file each slot's image lies.
    images: [Range<usize>; 2],
}

/// Bytes of the file's header that say something: magic, version, length and
/// checksum, then the wear of 512 blocks behind their number.
const HEADER: usize = 16 + 2 + 512;
/// Where the flash starts, with its boot log of six entries.
const LOG: Range<usize> = 4096..4096 + 6 * 16;

impl ChipFile {
    fn new() -> Self {
        let newer = exported();
        let older = sealed_anew(&newer, |manifest| manifest.provenance.seed += 1);
        let mut chip = Chip::blank();
        for (image, slot) in [(&older, Slot::A), (&newer, Slot::B)] {
            assert_eq!(chip.flash(image.as_slice(), None).unwrap().slot, slot);
            chip.boot().unwrap();
            chip.confirm().unwrap();
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
    let sampled = draws(2).take(100).map(|[word, _]| below(word, FILE_BYTES as u32) as usize);
    for length in (0..64).chain(sampled).chain([FILE_BYTES - 1]) {
        fs::write(&path, &whole[..length]).unwrap();
        let error = chip.read().unwrap_err();
        // Without the whole header it may be any file; with it, the size tells.
        let is_named = match error {
            ChipError::Header { .. } => length < HEADER,
            ChipError::Size { actual, .. } => actual == length && length >= HEADER,
            ChipError::File(_) => false,
        };
        assert!(is_named, "{length}: {error}");
    }
}

/// Whatever bit flips: the newer policy boots bit for bit, or the older one
/// does, and says why where it was not the log that was hit; or the chip is
/// refused by name.
#[test]
fn a_flipped_bit_on_a_chip_never_boots_a_policy_that_was_not_flashed() {
    let chip = ChipFile::new();
    let whole = fs::read(chip.run.path("robot.chip")).unwrap();
    let [older, newer] = chip.images.clone();
    // The header, the boot log, either image, and the whole flash, most of it erased.
    let regions = [0..HEADER, LOG, older, newer.clone(), 0..FILE_BYTES];
    let [mut refused, mut passed_over] = [0; 2];
    for (index, [word, shape]) in draws(3).take(1000).enumerate() {
        let region = regions[index % regions.len()].clone();
        let at = region.start + below(word, region.len() as u32) as usize;
        chip.set(at, whole[at] ^ (1 << (shape % 8)));
        match chip.read() {
            Err(error) => {
                assert!(at < HEADER && matches!(error, ChipError::Header { .. }), "byte {at}: {error}");
                refused += 1;
            }
            Ok(mut read) => {
                let boot = read.boot().unwrap();
                let expected = match boot.slot {
                    Slot::A => &chip.older,
                    Slot::B => &chip.newer,
                };
                assert_eq!(&boot.image, expected, "byte {at}");
                let in_newer = newer.contains(&at);
                // A log without its last entry says that the newer policy is on trial.
                assert!(boot.slot == Slot::B || in_newer || LOG.contains(&at), "byte {at}");
                if in_newer {
                    let fault = boot.passed_over.unwrap();
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
