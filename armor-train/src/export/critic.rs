//! The critic of a run in its image, for a controller that takes the best of several actions.

use armor_core::image::{Critic, Manifest, PolicyImage, SectionKind, WriteError};
use armor_core::units::CostLimit;

use super::quality::quality_best_of;
use super::{ExportError, ImageBytes, build};
use crate::model::Model;
use crate::run::Checkpoint;

/// An exported image with the critic that its policy learnt from, and with the
/// flights of the best of 4 and of 16 on its quality card.
///
/// # Errors
/// [`ExportError`]; [`ExportError::CriticLayout`] for a critic that an image cannot hold.
pub fn with_critic(image: &PolicyImage<'_>, checkpoint: &Checkpoint) -> Result<ImageBytes, ExportError> {
    let (config, manifest) = (&checkpoint.config, image.manifest());
    let critic = Model::new(config, manifest.shape.state.into(), manifest.shape.action.into()).critic;
    let parameters = checkpoint.state.parameters.critic_copy(config.policy_critic);
    let numbers = critic.deployed(parameters).ok_or(ExportError::CriticLayout)?;
    let cost_unit = config.cost_scale as f32;
    let kappa_scale = (critic.kappa_scale() * config.cost_scale) as f32;
    let header = [config.trunk as u32, config.head as u32, kappa_scale.to_bits(), cost_unit.to_bits()];
    const { assert!(Critic::HEADER_WORDS == 4) };

    let words: Vec<u32> = header.into_iter().chain(numbers.iter().map(|number| number.to_bits())).collect();
    let sections = SectionKind::ALL.map(|kind| match kind {
        SectionKind::Critic => words.clone(),
        kind => image.words(kind).to_vec(),
    });
    let draft = build(manifest, &sections)?;
    let flyable = PolicyImage::new_checked(draft.as_slice()).map_err(WriteError::Invalid)?;
    let golden = &image.sections().golden;
    let mut quality = manifest.quality.clone();
    // The card has room for the rungs of every ladder and for these.
    quality.extend(quality_best_of(&flyable, CostLimit::from_cost(golden.limit), golden.seed)?);
    build(&Manifest { quality, ..manifest.clone() }, &sections)
}
