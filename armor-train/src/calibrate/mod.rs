//! From the remaining budget to what the actor is conditioned on, chosen from data and critics alone.
//!
//! An actor conditioned on leniency is a family of policies, from the strictest
//! at 0 to the boldest at 1. An estimate says what an episode of each would
//! cost; the map gives every budget the boldest policy whose whole episode is
//! expected to fit into it. As the budget is spent the policy turns stricter,
//! and another limit needs no other training.
//!
//! | estimate | here |
//! |---|---|
//! | fitted Q evaluation of the policies themselves | [`fitted`] |
//! | what the trajectories cost that the policy imitates | [`returns`] |

pub mod fitted;
mod knots;
pub mod returns;

use std::path::PathBuf;

use firmware_sim::file::FileError;

pub use knots::{Knots, MAP_FILE};

use crate::extraction::condition::Condition;

/// Leniencies at which a family of policies is judged.
pub const GRID: usize = 17;

/// The leniencies of the grid, from 0 to 1.
pub fn grid() -> [f64; GRID] {
    std::array::from_fn(|place| place as f64 / (GRID - 1) as f64)
}

/// Why a run cannot be calibrated.
#[derive(Debug, thiserror::Error)]
pub enum CalibrateError {
    /// The actor is not conditioned on the price of cost.
    #[error("the run's actor is conditioned on {0:?}, which needs no calibration; it is for `condition` = lambda")]
    Condition(Condition),
    /// The run has not trained its actor yet.
    #[error("the run has done {done} steps and trains its actor from step {start}; resume it first")]
    Untrained {
        /// Steps done.
        done: u64,
        /// The actor's first step.
        start: u64,
    },
    /// The map's file could not be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The map's file holds no map.
    #[error(
        "{} holds no map: it needs 2 to 64 lines `budget,leniency` below its header, budgets rising, leniencies within 0 and 1 and never falling; calibrate again",
        path.display()
    )]
    Map {
        /// The file.
        path: PathBuf,
    },
}
