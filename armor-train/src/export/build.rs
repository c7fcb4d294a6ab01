//! Makes the image, measures it, and makes it again with what was measured.

use armor_core::image::{
    KappaRange, Layout, MAX_RUNGS, Manifest, PolicyImage, Precision, Provenance, Rung, SECTION_ALIGNMENT,
    SECTION_COUNT, SectionKind, write,
};
use armor_core::schedule::Sampler;
use armor_core::shape::Shape;
use armor_core::units::{Cost, CostLimit};
use armor_infer::Policy;
use heapless::Vec as FixedVec;
use sha2::{Digest, Sha256};

use super::agreement::{AGREEMENT_BOUND, Agreement, agreement};
use super::sections::sections;
use super::{ExportError, ImageBytes, golden, quality};
use crate::actor::Actor;
use crate::calibrate::Knots;
use crate::config::Config;
use crate::data::Dataset;
use crate::extraction::condition::Condition;
use crate::model::Model;
use crate::normaliser::Normaliser;
use crate::run::Checkpoint;

/// Steps of the rungs below the trained chain.
const SHORTER: [u16; 4] = [10, 5, 2, 1];
/// Bytes of an image beyond its sections: header, manifest and padding are far below.
const OVERHEAD: usize = 4096;

/// An image with what was measured on it.
#[derive(Clone, Debug)]
pub struct Exported {
    /// The image.
    pub bytes: ImageBytes,
    /// How far its actions are from the trainer's.
    pub agreement: Agreement,
}

/// The image of a checkpoint's actor in f32, with `map` from the remaining
/// budget where the actor is conditioned on the price of cost.
///
/// # Errors
/// [`ExportError`]
pub fn export(checkpoint: &Checkpoint, data: &Dataset, map: Option<&Knots>) -> Result<Exported, ExportError> {
    let config = &checkpoint.config;
    let budget_map = match config.condition {
        Condition::Kappa => Vec::new(),
        Condition::Lambda => map.ok_or(ExportError::NotCalibrated)?.words(),
        Condition::None => Knots::constant(0.0).words(),
    };
    let actor = Model::new(config, data.state_dim(), data.action_dim()).actor;
    let parameters = checkpoint.state.flying_actor();
    let normaliser = Normaliser::new(data, config.normalize_states);
    let manifest = manifest(checkpoint, &actor, data);

    let network = (&actor.denoiser, &actor.process, parameters);

    // A trace without rows, to have an image that the controller can fly.
    let draft = build(&manifest, &sections(network, &normaliser, &manifest.rungs, [&[0; 4], &budget_map]))?;
    let image = PolicyImage::new_checked(draft.as_slice()).map_err(armor_core::image::WriteError::Invalid)?;
    let policy = Policy::load(&image)?;
    let limit = flyable_limit(config, &manifest);
    let trace = golden::record(policy, data, limit, config.seed)?;
    let agreement =
        agreement((&actor, parameters, config.cost_scale), &normaliser, (policy, image.sections().budget_map), data)?;
    if agreement.agreement_max_abs > AGREEMENT_BOUND {
        return Err(ExportError::Disagreement { found: agreement.agreement_max_abs });
    }

    let quality = quality(&image, limit, config.seed)?;
    let manifest = Manifest { agreement_max_abs: agreement.agreement_max_abs, quality, ..manifest };
    let bytes = build(&manifest, &sections(network, &normaliser, &manifest.rungs, [&trace, &budget_map]))?;
    Ok(Exported { bytes, agreement })
}

/// The ladder of a network with `steps` noise levels: the trained chain, then shorter deterministic ones.
pub(crate) fn ladder(steps: u16) -> FixedVec<Rung, MAX_RUNGS> {
    let trained = Rung { sampler: Sampler::Ddpm, steps };
    let shorter = SHORTER.into_iter().filter(|&length| length < steps);
    [trained].into_iter().chain(shorter.map(|steps| Rung { sampler: Sampler::Ddim, steps })).collect()
}

/// The trained limit, or the largest budget of the data where that is smaller.
fn flyable_limit(config: &Config, manifest: &Manifest<'_>) -> CostLimit {
    let limit = CostLimit::new(config.limit as f32).map_or(Cost::MAX, CostLimit::cost);
    CostLimit::from_cost(limit.min(manifest.kappa.trained_max))
}

fn manifest<'a>(checkpoint: &'a Checkpoint, actor: &Actor, data: &Dataset) -> Manifest<'a> {
    let config = &checkpoint.config;
    let widths = actor.denoiser.widths();
    let shape = Shape {
        state: widths.state as u16,
        action: widths.action as u16,
        hidden: widths.hidden as u16,
        kappa_hidden: widths.kappa_hidden as u16,
        kappa_embedding: widths.kappa_embedding as u16,
        steps: widths.steps as u16,
    };
    Manifest {
        task: &config.task,
        release: 0,
        shape,
        precision: Precision::F32,
        layout: Layout::Rows,
        kappa: KappaRange {
            scale: match config.condition {
                // The trainer scales costs before they enter a network.
                Condition::Kappa => (config.cost_scale * config.kappa_scale) as f32,
                Condition::Lambda | Condition::None => config.condition_scale() as f32,
            },
            trained_max: Cost::from_incurred(data.max_kappa()).unwrap_or(Cost::MAX),
        },
        schedule: actor.process.schedule,
        rungs: ladder(shape.steps),
        provenance: Provenance {
            version: env!("CARGO_PKG_VERSION"),
            preset: config.preset.name(),
            seed: config.seed,
            steps: checkpoint.state.step,
            data_sha256: checkpoint.data_sha256,
            config_sha256: Sha256::digest(config.options().to_string()).into(),
        },
        agreement_max_abs: 0.0,
        quality: Default::default(),
        sections: Default::default(),
    }
}

/// The same image as release `release` of its task's policy.
///
/// # Errors
/// [`ExportError::Write`]
pub fn released(image: &PolicyImage<'_>, release: u32) -> Result<ImageBytes, ExportError> {
    let sections = SectionKind::ALL.map(|kind| image.words(kind).to_vec());
    build(&Manifest { release, ..image.manifest().clone() }, &sections)
}

/// Writes an image into memory of its size.
pub(crate) fn build(manifest: &Manifest<'_>, sections: &[Vec<u32>; SECTION_COUNT]) -> Result<ImageBytes, ExportError> {
    let capacity =
        OVERHEAD + sections.iter().map(|words| (4 * words.len()).next_multiple_of(SECTION_ALIGNMENT)).sum::<usize>();
    let mut bytes = ImageBytes::filled(0, capacity);
    let length = write(manifest, &sections.each_ref().map(Vec::as_slice), bytes.as_mut_slice())?;
    Ok(ImageBytes::from(&bytes.as_slice()[..length]))
}
