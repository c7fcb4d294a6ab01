//! Whether damage is noticed: flipped bits and missing bytes, everywhere in
//! header and manifest, at random places in the sections.

use armor_core::image::PolicyImage;
use armor_core::noise::{Noise, below};

use crate::memory::AlignedBytes;

/// Damages drawn at random in the sections, of each kind.
const SAMPLES: u64 = 2000;

/// What a check found: figures, or what went unnoticed.
type Outcome = Result<String, String>;

/// Runs every check of damage on an image; random places are drawn from `seed`.
pub(super) fn run(image: &PolicyImage<'_>, seed: u64) -> [(&'static str, Outcome); 4] {
    let whole = image.bytes();
    let front = front_bytes(image);
    // Each bit of a byte, then all of them.
    let masks = || (0..8).map(|bit| 1u8 << bit).chain([0xFF]);
    let every_flip = (0..front).flat_map(|at| masks().map(move |mask| (at, mask)));
    let draws = |stream: u32| {
        let noise = Noise::new(seed);
        (0..SAMPLES).map(move |i| noise.words(stream, i, 0))
    };
    let body = (whole.len() - front) as u32;
    let place = move |word: u32| front + below(word, body) as usize;
    [
        ("header, manifest: flips", flips(whole, every_flip)),
        ("header, manifest: cuts", cuts(whole, 0..front)),
        ("sections: flips", flips(whole, draws(0).map(|[at, mask, ..]| (place(at), 1 + below(mask, 255) as u8)))),
        ("sections: cuts", cuts(whole, draws(1).map(|[at, ..]| place(at)))),
    ]
}

/// Length of header and manifest with its padding; the sections are what follows.
fn front_bytes(image: &PolicyImage<'_>) -> usize {
    let sections = image.manifest().sections.last().map_or(0, |last| last.offset as usize + last.length as usize);
    image.bytes().len() - sections
}

fn flips(whole: &[u8], damages: impl Iterator<Item = (usize, u8)>) -> Outcome {
    let mut copy = AlignedBytes::from(whole);
    let mut count = 0;
    for (at, mask) in damages {
        copy.as_mut_slice()[at] ^= mask;
        let noticed = PolicyImage::new_checked(copy.as_slice()).is_err();
        copy.as_mut_slice()[at] ^= mask;
        if !noticed {
            return Err(format!("byte {at} xor {mask:#04x} went unnoticed"));
        }
        count += 1;
    }
    Ok(format!("{count} of {count} rejected"))
}

fn cuts(whole: &[u8], lengths: impl Iterator<Item = usize>) -> Outcome {
    let mut count = 0;
    for length in lengths {
        if PolicyImage::new_checked(&whole[..length]).is_ok() {
            return Err(format!("a cut to {length} bytes went unnoticed"));
        }
        count += 1;
    }
    Ok(format!("{count} of {count} rejected"))
}
