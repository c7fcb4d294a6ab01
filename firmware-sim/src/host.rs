//! The controller as this host builds it: large enough for every task of the paper.

use armor_core::image::{ImageError, PolicyImage};
use armor_core::units::CostLimit;
use armor_infer::golden::{self, GoldenError};
use armor_infer::{BestOf, Controller, LoadError, Policy, Step};
use thiserror::Error;

/// The largest state vector that the host's controller senses.
pub const STATE: usize = 128;
/// The largest action vector that it answers.
pub const ACTION: usize = 16;
/// The widest layer that it computes.
pub const HIDDEN: usize = 512;

/// The host's controller.
pub type HostController<'a> = Controller<'a, STATE, ACTION, HIDDEN>;

/// How many candidates the host's controller can draw for an action.
pub const CANDIDATES: [u8; 5] = [1, 2, 4, 8, 16];

/// What flies: a controller of any number of candidates.
pub trait Pilot {
    /// As [`Controller::new_episode`].
    ///
    /// # Errors
    /// [`LoadError`]
    fn new_episode(&mut self, limit: CostLimit, seed: u64) -> Result<(), LoadError>;

    /// As [`Controller::step_within`].
    fn step_within(&mut self, state: &[f32], incurred: f32, steps: usize) -> Step<ACTION>;
}

impl Pilot for HostController<'_> {
    fn new_episode(&mut self, limit: CostLimit, seed: u64) -> Result<(), LoadError> {
        self.new_episode(limit, seed)
    }

    fn step_within(&mut self, state: &[f32], incurred: f32, steps: usize) -> Step<ACTION> {
        self.step_within(state, incurred, steps)
    }
}

impl<const K: usize> Pilot for BestOf<'_, STATE, ACTION, HIDDEN, K> {
    fn new_episode(&mut self, limit: CostLimit, seed: u64) -> Result<(), LoadError> {
        self.new_episode(limit, seed)
    }

    fn step_within(&mut self, state: &[f32], incurred: f32, steps: usize) -> Step<ACTION> {
        self.step_within(state, incurred, steps)
    }
}

/// The controller of an image that draws `candidates` for every action, one of
/// [`CANDIDATES`] (what is more counts as the most), and takes the best.
///
/// # Errors
/// [`LoadError`]
pub fn pilot<'a>(
    image: &PolicyImage<'a>,
    limit: CostLimit,
    seed: u64,
    candidates: u8,
) -> Result<Box<dyn Pilot + 'a>, LoadError> {
    Ok(match candidates {
        0 | 1 => Box::new(HostController::new(Policy::load(image)?, limit, seed)?),
        2 => Box::new(BestOf::<STATE, ACTION, HIDDEN, 2>::new(image, limit, seed)?),
        3 | 4 => Box::new(BestOf::<STATE, ACTION, HIDDEN, 4>::new(image, limit, seed)?),
        5..=8 => Box::new(BestOf::<STATE, ACTION, HIDDEN, 8>::new(image, limit, seed)?),
        9.. => Box::new(BestOf::<STATE, ACTION, HIDDEN, 16>::new(image, limit, seed)?),
    })
}

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
