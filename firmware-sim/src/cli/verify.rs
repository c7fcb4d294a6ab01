//! `firmware-sim verify`

use std::path::PathBuf;

use super::output::{CommandResult, Output};
use crate::image_file::ImageFile;
use crate::verify;

/// Where the sampled damages are drawn from.
const SEED: u64 = 0;

/// Check an image: golden trace, agreement with an f64 evaluation, and that
/// every damage to it is noticed.
#[derive(Debug, clap::Args)]
pub(super) struct Verify {
    /// The policy image.
    image: PathBuf,
}

impl Verify {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let file = ImageFile::read(&self.image)?;
        output.note(format_args!("verifying {}", self.image.display()));
        let verification = verify::verify(file.bytes(), SEED);
        output.report(&verification)?;
        match verification.failures() {
            0 => Ok(()),
            failures => {
                let (path, checks) = (self.image.display(), verification.checks.len());
                Err(format!("{path} failed {failures} of {checks} checks; do not fly it").into())
            }
        }
    }
}
