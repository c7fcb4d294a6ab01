//! Damaged files: cut anywhere, bits flipped anywhere. Always a named fault or
//! a sound data set, never a panic.

use std::fs;
use std::io::Cursor;

use armor_core::noise::{Noise, below};
use armor_train::data::{Dataset, Fault};

use crate::{contents, fixture, shipped_file};

fn read(bytes: &[u8]) -> Result<Dataset, Fault> {
    Dataset::from_reader(Cursor::new(bytes.to_vec()))
}

#[track_caller]
fn assert_named(bytes: usize, whole: usize, result: Result<Dataset, Fault>) {
    let (cut, expected) = (bytes as u64, whole as u64);
    match result.unwrap_err() {
        // The 8 bytes of the signature, the 96 of the superblock, the rest.
        Fault::NotHdf5 { bytes } => assert!(bytes == cut && cut < 8),
        Fault::Damaged { .. } => assert!((8..96).contains(&cut), "cut at {cut}"),
        fault => assert_eq!(fault, Fault::Truncated { bytes: cut, expected }),
    }
}

#[test]
fn a_file_cut_anywhere_is_named_as_such() {
    let small = fs::read(fixture("small.hdf5")).unwrap();
    for bytes in 0..small.len() {
        assert_named(bytes, small.len(), read(&small[..bytes]));
    }

    let shipped = fs::read(shipped_file()).unwrap();
    let spread = (0..200).map(|cut| cut * shipped.len() / 200);
    for bytes in spread.chain([1, 7, 8, 95, 96, 97, 2048, shipped.len() - 1]) {
        assert_named(bytes, shipped.len(), read(&shipped[..bytes]));
    }
}

/// The superblock's end-of-file address is at byte 40; set to the cut, the
/// damage is left for the deeper structures to show.
#[test]
fn a_file_cut_behind_the_superblocks_back_is_damaged_or_whole() {
    let small = fs::read(fixture("small.hdf5")).unwrap();
    let whole = read(&small).unwrap();
    let mut damaged = 0;
    for bytes in 48..small.len() {
        let mut cut = small[..bytes].to_vec();
        cut[40..48].copy_from_slice(&(bytes as u64).to_le_bytes());
        match read(&cut) {
            // What was cut is space that no data set uses.
            Ok(dataset) => assert_eq!(contents(&dataset), contents(&whole)),
            Err(fault) => {
                assert!(matches!(fault, Fault::Damaged { .. }), "{fault}");
                damaged += 1;
            }
        }
    }
    assert!(damaged > small.len() / 2);
}

/// Old HDF5 structures and raw data carry no checksum, so a flip may read as
/// other data; what is read must still be sound.
#[test]
fn a_flipped_bit_is_a_named_fault_or_a_sound_data_set() {
    let noise = Noise::new(0);
    for name in ["small.hdf5", "small-v114.hdf5"] {
        let mut bytes = fs::read(fixture(name)).unwrap();
        let mut faults = 0;
        for position in 0..bytes.len() {
            let flip = 1 << below(noise.words(0, position as u64, 0)[0], 8);
            bytes[position] ^= flip;
            match read(&bytes) {
                Ok(dataset) => assert_sound(&dataset),
                Err(_) => faults += 1,
            }
            bytes[position] ^= flip;
        }
        assert!(faults > 500, "{faults} faults in {name}");
    }
}

#[test]
fn many_overwritten_bytes_are_a_named_fault_or_a_sound_data_set() {
    let small = fs::read(fixture("small.hdf5")).unwrap();
    for trial in 0..4000 {
        let mut bytes = small.clone();
        for block in 0..16 {
            let [position, value, ..] = Noise::new(1).words(0, trial, block);
            bytes[below(position, small.len() as u32) as usize] = value as u8;
        }
        if let Ok(dataset) = read(&bytes) {
            assert_sound(&dataset);
        }
    }
}

/// The promises of a data set that was read without a fault.
fn assert_sound(dataset: &Dataset) {
    assert!(!dataset.is_empty());
    for ([observation, next, action], [reward, cost], _) in contents(dataset) {
        assert_eq!((observation.len(), next.len()), (dataset.state_dim(), dataset.state_dim()));
        assert_eq!(action.len(), dataset.action_dim());
        assert!(observation.iter().chain(next).all(|value| value.is_finite()) && reward.is_finite());
        assert!(action.iter().all(|action| action.abs() <= 1.0));
        assert!((0.0..=65536.0).contains(&cost));
    }
    assert!(dataset.done(dataset.len() - 1));
}
