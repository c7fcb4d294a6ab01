//! What an image says of itself, encoded by postcard.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use super::ImageError;
use super::layout::Layout;
use crate::fixed::{LONG_BITS, SHORT_BITS};
use crate::schedule::{MAX_STEPS, Sampler, Schedule};
use crate::shape::Shape;
use crate::units::Cost;

/// Chains an image may carry.
pub const MAX_RUNGS: usize = 8;
/// Sections of an image.
pub const SECTION_COUNT: usize = SectionKind::ALL.len();

/// The manifest of an image; text is borrowed from its bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest<'a> {
    /// The task that the policy was trained for, such as `ball-run`.
    pub task: &'a str,
    /// Number of this release of the task's policy: a chip takes none below that of its confirmed policy.
    pub release: u32,
    /// Dimensions of the network.
    pub shape: Shape,
    /// Number format of weights and activations.
    pub precision: Precision,
    /// Order of the weights of an integer network; [`Layout::Rows`] in single precision, which has one order.
    pub layout: Layout,
    /// How the remaining budget enters the network.
    pub kappa: KappaRange,
    /// The noise schedule behind the chains.
    pub schedule: Schedule,
    /// The chains that the policy may fly, none longer than the one before.
    pub rungs: Vec<Rung, MAX_RUNGS>,
    /// Where the policy comes from.
    pub provenance: Provenance<'a>,
    /// Largest difference of an action entry between trainer and image, measured at export.
    pub agreement_max_abs: f32,
    /// Flights of this policy on the task's native plant; empty where there is none.
    pub quality: Vec<Quality, MAX_RUNGS>,
    /// Where each section lies; in the order of [`SectionKind::ALL`], without those that are left out.
    pub sections: Vec<Section, SECTION_COUNT>,
}

/// Number format of weights and activations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// IEEE-754 single precision.
    F32,
    /// 8-bit weights, 15-bit activations ([`crate::fixed`]).
    Int16x8,
    /// 8-bit weights, 7-bit activations between the hidden layers.
    Int8,
}

impl Precision {
    /// Bits of the codes between the hidden layers; none in single precision.
    pub const fn code_bits(self) -> Option<u32> {
        match self {
            Self::F32 => None,
            Self::Int16x8 => Some(LONG_BITS),
            Self::Int8 => Some(SHORT_BITS),
        }
    }
}

/// How the remaining budget enters the network.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct KappaRange {
    /// The embedding sees `scale * kappa`.
    pub scale: f32,
    /// The largest budget in the training data; a larger limit is refused.
    pub trained_max: Cost,
}

/// A chain: a sampler and its number of steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rung {
    /// How the chain moves.
    pub sampler: Sampler,
    /// Calls of the denoiser, 1 to `N`.
    pub steps: u16,
}

/// Where a policy comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Provenance<'a> {
    /// Version of the trainer.
    pub version: &'a str,
    /// Preset that the training started from.
    pub preset: &'a str,
    /// Seed of the training.
    pub seed: u64,
    /// Training steps behind the weights.
    pub steps: u64,
    /// SHA-256 of the recorded data.
    pub data_sha256: [u8; 32],
    /// SHA-256 of the effective configuration.
    pub config_sha256: [u8; 32],
}

/// A flight of the policy, measured at export.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Which rung flew.
    pub rung: u8,
    /// Cost limit of the flight.
    pub limit: Cost,
    /// Actions among which the critic chose at each step; 1 where there was no choice.
    pub candidates: u8,
    /// Episodes flown.
    pub episodes: u16,
    /// Mean normalised reward (Eq. 17).
    pub reward_normalized: f32,
    /// Mean normalised cost (Eq. 17).
    pub cost_normalized: f32,
}

/// Where a section lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Section {
    /// What it holds.
    pub kind: SectionKind,
    /// Bytes from the end of the padded manifest to its start.
    pub offset: u32,
    /// Its length in bytes, without padding.
    pub length: u32,
}

/// What a section holds, in single precision; `docs/image-format.md` has the
/// integer layouts too. A section is 32-bit little-endian words; a matrix from
/// `I` inputs to `O` outputs is stored input by input, `O` words each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum SectionKind {
    /// Mean `[S]` and factor `[S]`: the network sees `(s - mean) * factor`.
    StateNormaliser,
    /// Low `[A]`, high `[A]` and fallback action `[A]`.
    ActionBounds,
    /// First layer of the kappa embedding: matrix `1 x K`, bias `[K]`.
    Kappa1,
    /// Second layer of the kappa embedding: matrix `K x K`, bias `[K]`.
    Kappa2,
    /// Third layer of the kappa embedding: matrix `K x E`, bias `[E]`.
    Kappa3,
    /// The part of layer 1 computed once an action: matrices `S x H` and `E x H`, bias `[H]`.
    Context,
    /// The time embedding's part of layer 1: row `n - 1` holds `[H]` for noise level `n`, `N` rows.
    TimeTable,
    /// The noisy action's part of layer 1: matrix `A x H`.
    ActionInput,
    /// Layer 2: matrix `H x H`, bias `[H]`.
    Hidden2,
    /// Layer 3: matrix `H x H`, bias `[H]`.
    Hidden3,
    /// Output layer: matrix `H x A`, bias `[A]`.
    Output,
    /// The scales of an integer network; empty in single precision.
    Scales,
    /// The steps of all rungs, one rung after the other (`ChainStep::to_words`).
    Chain,
    /// The golden trace: what the controller must reproduce bit for bit.
    Golden,
    /// Knots from the remaining budget to the condition of the policy; left out where that is the budget itself.
    BudgetMap,
    /// The critic that a choice between several actions is taken by; left out where no choice is to be taken.
    Critic,
}

impl SectionKind {
    /// All sections, in the order in which they lie in an image.
    pub const ALL: [Self; 16] = [
        Self::StateNormaliser,
        Self::ActionBounds,
        Self::Kappa1,
        Self::Kappa2,
        Self::Kappa3,
        Self::Context,
        Self::TimeTable,
        Self::ActionInput,
        Self::Hidden2,
        Self::Hidden3,
        Self::Output,
        Self::Scales,
        Self::Chain,
        Self::Golden,
        Self::BudgetMap,
        Self::Critic,
    ];

    /// Whether an image may do without the section; it then has no entry in the table.
    pub(super) const fn is_optional(self) -> bool {
        matches!(self, Self::BudgetMap | Self::Critic)
    }
}

impl<'a> Manifest<'a> {
    /// Decodes the first `length` bytes; the rest is padding and must be zero.
    pub(super) fn read(padded: &'a [u8], length: usize) -> Result<Self, ImageError> {
        let (encoded, padding) = padded.split_at_checked(length).ok_or(ImageError::Header)?;
        let (manifest, rest) = postcard::take_from_bytes::<Self>(encoded).map_err(|_| ImageError::Manifest)?;
        if !rest.is_empty() || padding.iter().any(|&byte| byte != 0) {
            return Err(ImageError::Manifest);
        }
        manifest.check()?;
        Ok(manifest)
    }

    /// Whether every field lies in the range that the format gives it.
    pub(super) fn check(&self) -> Result<(), ImageError> {
        if !self.shape.is_valid() {
            return Err(ImageError::Shape);
        }
        if self.precision == Precision::F32 && self.layout != Layout::Rows {
            return Err(ImageError::Manifest);
        }
        let steps = usize::from(self.shape.steps);
        if self.schedule.steps != steps || steps > MAX_STEPS || self.rungs.is_empty() {
            return Err(ImageError::Chain);
        }
        if self.rungs.iter().any(|rung| !(1..=self.shape.steps).contains(&rung.steps)) {
            return Err(ImageError::Chain);
        }
        if !self.rungs.is_sorted_by(|longer, shorter| longer.steps >= shorter.steps) {
            return Err(ImageError::Chain);
        }
        if !(self.kappa.scale.is_finite() && self.kappa.scale > 0.0) {
            return Err(ImageError::KappaRange);
        }
        Ok(())
    }
}
