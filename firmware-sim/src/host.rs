//! The controller as this host builds it: large enough for every task of the paper.

use armor_core::image::{ImageError, PolicyImage};
use armor_infer::golden::{self, GoldenError};
use armor_infer::{Controller, Policy};
use thiserror::Error;

/// The largest state vector that the host's controller senses.
pub const STATE: usize = 128;
/// The largest action vector that it answers.
pub const ACTION: usize = 16;
/// The widest layer that it computes.
pub const HIDDEN: usize = 512;

/// The host's controller.
pub type HostController<'a> = Controller<'a, STATE, ACTION, HIDDEN>;

/// Why bytes are no policy that this host may fly.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum Unfit {
    /// The bytes are no whole and valid image.
    #[error("{0}")]
    Image(ImageError),
    /// The image's own trace is not reproduced bit for bit.
    #[error("{0}")]
    Golden(GoldenError),
}

/// An image that the host's controller has proved to reproduce.
#[derive(Clone, Debug)]
pub struct Flyable<'a> {
    /// The image.
    pub image: PolicyImage<'a>,
    /// Its policy.
    pub policy: Policy<'a>,
    /// Rows of the golden trace that were replayed.
    pub golden_rows: usize,
}

/// Checks an image and replays its golden trace; `bytes` start at a multiple
/// of 16, what follows the image is ignored.
///
/// # Errors
/// [`Unfit`]
pub fn check(bytes: &[u8]) -> Result<Flyable<'_>, Unfit> {
    let image = PolicyImage::new_checked(bytes).map_err(Unfit::Image)?;
    let golden_rows = golden::replay::<STATE, ACTION, HIDDEN>(&image).map_err(Unfit::Golden)?;
    let policy = Policy::load(&image).map_err(|error| Unfit::Golden(GoldenError::Load(error)))?;
    Ok(Flyable { image, policy, golden_rows })
}
