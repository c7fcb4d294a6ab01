//! Recorded data in the DSRL layout: read, checked, counted, and made ready for training.
//!
//! ```text
//! file --hdf5--> Columns --dataset--> Dataset --stats--> Table 1
//!    Recording --/ \--check--> every fault and warning
//! ```
//!
//! Bytes are checked once: whatever a [`Dataset`] holds is finite, costs are at
//! least 0, actions lie in `[-1, 1]`, and every trajectory has an end.
//!
//! Words: a *row* or *transition* is one control step; a *trajectory* is an
//! episode from its first row to the row with the end mark; *kappa* is the cost
//! still to come in it.

mod check;
mod columns;
mod dataset;
mod ending;
mod error;
mod hdf5;
mod key;
mod moments;
mod perturb;
mod recording;
mod scan;
mod sorted;
mod states;
mod stats;
mod togo;
mod writer;

pub use check::{Report, Warning, check};
pub use dataset::{Dataset, Trajectory};
pub use ending::{Ending, Mask, Unfinished};
pub use error::{DataError, Fault};
pub use key::Key;
pub use moments::StateMoments;
pub use perturb::Perturbation;
pub use recording::Recording;
pub(crate) use sorted::Sorted;
pub use stats::{Stats, feasible_mass};
pub use togo::ToGo;
pub use writer::to_hdf5;
