//! `firmware-sim flash`

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;

use super::output::{CommandResult, Output};
use crate::chip::{Chip, Flashed, SLOT_BYTES, Slot};
use crate::image_file::ImageFile;

/// Flash an image to a simulated chip, which is made if there is none, to be
/// tried at its next boot.
///
/// The confirmed policy stays in the other slot until the new one has flown.
/// An image that does not check, or is for another task, is refused.
#[derive(Debug, clap::Args)]
pub(super) struct Flash {
    /// The policy image.
    image: PathBuf,
    /// The chip file.
    #[arg(long)]
    chip: PathBuf,
    /// Where to put it; the slot without a confirmed policy, if not given.
    #[arg(long)]
    slot: Option<Slot>,
}

#[derive(Serialize)]
struct Report {
    chip: PathBuf,
    #[serde(flatten)]
    flashed: Flashed,
    slot_bytes: usize,
}

impl Flash {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let file = ImageFile::read(&self.image)?;
        file.image()?;
        let mut chip = if self.chip.exists() { Chip::read(&self.chip)? } else { Chip::blank() };
        let flashed = chip.flash(file.bytes(), self.slot)?;
        chip.write(&self.chip)?;
        output.report(&Report { chip: self.chip, flashed, slot_bytes: SLOT_BYTES })
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Flashed { slot, image_bytes, golden_rows } = self.flashed;
        writeln!(f, "flashed to slot {slot} of {}", self.chip.display())?;
        writeln!(f, "image               {image_bytes:>10} of {} bytes", self.slot_bytes)?;
        write!(f, "golden trace        {golden_rows:>10} rows, bit for bit")
    }
}
