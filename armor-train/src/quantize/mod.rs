//! From a policy in single precision to one in integers ([`armor_core::fixed`]).
//!
//! The weights of a row share a scale (symmetric, 8 bits); the codes of a
//! hidden layer share one at each noise level, calibrated on recorded states
//! and the policy's own chains. What the codes' lowest value and the rounding
//! of the weights shift a sum by on average goes into its bias.
//!
//! The policy that comes out is measured on what it is for: its actions
//! against the single-precision image on recorded states, and its flights on
//! the task's native plant ([`Drift`]).

mod calibration;
mod drift;
mod network;
mod weights;

use armor_core::image::{Layout, Manifest, PolicyImage, Precision, SECTION_COUNT, SectionKind};
use armor_core::units::CostLimit;
use armor_infer::Policy;

use crate::data::Dataset;
use crate::export::{Agreement, ExportError, ImageBytes, build, quality, record_golden};

use calibration::Calibration;
pub use drift::{COST_BOUND, Drift, REWARD_BOUND, RungDrift};

/// An image in integers, with what was measured on it.
#[derive(Clone, Debug)]
pub struct Quantized {
    /// The image.
    pub bytes: ImageBytes,
    /// How far its actions are from those of the single-precision image.
    pub agreement: Agreement,
    /// How far its flights are; empty where the task has no native plant.
    pub drift: Drift,
}

/// The policy of a single-precision image, in integers, its weights in `layout`.
///
/// # Errors
/// [`ExportError`]
pub fn quantize(
    image: &PolicyImage<'_>,
    data: &Dataset,
    precision: Precision,
    layout: Layout,
) -> Result<Quantized, ExportError> {
    let Some(bits) = precision.code_bits() else { return Err(ExportError::NotInteger) };
    let calibration = Calibration::new(image, data)?;
    let network = network::sections(image, &calibration, bits, layout)?;
    let golden = &image.sections().golden;
    let manifest = Manifest { precision, layout, ..image.manifest().clone() };
    let contents = |trace: &[u32]| -> [Vec<u32>; SECTION_COUNT] {
        SectionKind::ALL.map(|kind| match kind {
            SectionKind::Golden => trace.to_vec(),
            kind => network.get(&kind).cloned().unwrap_or_else(|| image.words(kind).to_vec()),
        })
    };

    // A trace without rows, to have an image that the controller can fly.
    let draft = build(&manifest, &contents(&[0; 4]))?;
    let flyable = PolicyImage::new_checked(draft.as_slice()).map_err(armor_core::image::WriteError::Invalid)?;
    let policy = Policy::load(&flyable)?;
    let limit = CostLimit::from_cost(golden.limit);
    let trace = record_golden(policy, data, limit, golden.seed)?;
    let agreement = drift::agreement(Policy::load(image)?, policy, data)?;
    let quality = quality(&flyable, limit, golden.seed)?;
    let drift = Drift::new(&image.manifest().quality, &quality);

    let manifest = Manifest { agreement_max_abs: agreement.agreement_max_abs, quality, ..manifest };
    Ok(Quantized { bytes: build(&manifest, &contents(&trace))?, agreement, drift })
}
