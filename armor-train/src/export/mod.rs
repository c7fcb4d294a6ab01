//! From a run's checkpoint to a policy image.
//!
//! What the image says of itself is measured here, on the image: the golden
//! trace is flown by the controller, and the agreement with the trainer's own
//! forward pass is taken over recorded states and budgets.

mod agreement;
mod build;
mod critic;
mod golden;
mod quality;
mod sections;

use armor_core::image::{SectionKind, WriteError};
use armor_infer::LoadError;
use firmware_sim::memory::AlignedBytes;

pub use agreement::{AGREEMENT_BOUND, AGREEMENT_SAMPLES, Agreement, agreement};
pub use build::{Exported, export, released};
pub(crate) use build::{build, ladder};
pub use critic::with_critic;
pub(crate) use golden::{fly_golden, record as record_golden};
pub(crate) use quality::quality;
pub(crate) use sections::sections;

/// Why a policy could not be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The numbers make no valid image.
    #[error("the policy cannot be written: {0}")]
    Write(#[from] WriteError),
    /// The host's controller cannot hold the policy.
    #[error("the policy is too large for the controller: {0}")]
    Load(#[from] LoadError),
    /// The controller met a fault while it flew the golden trace.
    #[error("the exported policy fails on recorded states ({0}); train it again")]
    Fault(armor_infer::Fault),
    /// The policy does not fly on its task's plant.
    #[error("the exported policy cannot fly: {0}")]
    Flight(#[from] firmware_sim::flight::FlightError),
    /// Trainer and image disagree.
    #[error(
        "trainer and image differ by {found:e} in an action, more than {AGREEMENT_BOUND:e}; this is a defect, please report it"
    )]
    Disagreement {
        /// The largest difference.
        found: f32,
    },
    /// A policy cannot be quantised twice.
    #[error("only a policy in single precision can be quantised; export the run again")]
    NotFloat,
    /// There are no integers of single precision.
    #[error("single precision has no integers; export it as f32")]
    NotInteger,
    /// A number of the network is too large for its place in an integer image.
    #[error("the weights of {0:?} are too large for integers; export the policy as f32")]
    Range(SectionKind),
    /// The actor is conditioned on the price of cost, and nothing says which price a budget asks for.
    #[error(
        "the policy is conditioned on the price of cost and has no map from the budget to it yet; run `armor-train calibrate` on the run's folder first"
    )]
    NotCalibrated,
    /// An image has no room for this critic.
    #[error(
        "an image holds only a critic with critic_trunk = \"shared\", head_layers = 1 and cost_output = \"linear\"; train with these, or export without --critic"
    )]
    CriticLayout,
    /// The data has no trajectory.
    #[error("the data has no trajectory to take a golden trace from")]
    NoTrajectory,
}

/// An image in memory, at an aligned address.
pub(crate) type ImageBytes = AlignedBytes;
