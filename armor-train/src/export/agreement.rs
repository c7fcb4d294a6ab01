//! How far the image's actions are from the trainer's.

use armor_core::budget_map::BudgetMap;
use armor_core::noise::{Noise, below};
use armor_core::schedule::Sampler;
use armor_core::units::{Cost, CostLimit};
use armor_infer::Policy;
use firmware_sim::host::HostController;
use nalgebra::DMatrix;
use serde::Serialize;

use super::ExportError;
use crate::actor::Actor;
use crate::actor::chain::Chain;
use crate::data::Dataset;
use crate::normaliser::Normaliser;

/// Recorded states and budgets that are compared.
pub const AGREEMENT_SAMPLES: usize = 1024;
/// The largest difference of an action entry that is accepted.
pub const AGREEMENT_BOUND: f32 = 1e-4;

/// The comparison of trainer and image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Agreement {
    /// Largest difference of an action entry.
    pub agreement_max_abs: f32,
    /// Root mean square of the differences.
    pub agreement_rms: f32,
    /// Recorded states and budgets compared.
    pub agreement_samples: usize,
}

impl Agreement {
    /// Sums up the differences of all action entries, as magnitudes.
    pub(crate) fn new(differences: &[f32], samples: usize) -> Self {
        let squares: f64 = differences.iter().map(|&difference| f64::from(difference).powi(2)).sum();
        // By total order a NaN is the largest, and not lost.
        let largest = differences.iter().copied().max_by(f32::total_cmp);
        Self {
            agreement_max_abs: largest.unwrap_or_default(),
            agreement_rms: (squares / differences.len().max(1) as f64).sqrt() as f32,
            agreement_samples: samples,
        }
    }
}

/// Compares the controller's first action with the trainer's chain over random
/// recorded states and budgets; sample `i` takes its chain noise from seed `i` on both sides.
///
/// # Errors
/// [`ExportError::Load`] if the controller cannot hold the policy.
pub fn agreement(
    (actor, parameters, cost_scale): (&Actor, &[f32], f64),
    normaliser: &Normaliser,
    (policy, map): (Policy<'_>, Option<BudgetMap<'_>>),
    data: &Dataset,
) -> Result<Agreement, ExportError> {
    let rows: Vec<usize> = (0..AGREEMENT_SAMPLES)
        .map(|sample| below(Noise::new(sample as u64).words(u32::MAX, 0, 0)[0], data.len() as u32) as usize)
        .collect();
    // The budget as the controller counts it.
    let kappas: Vec<Cost> = rows.iter().map(|&row| Cost::from_incurred(data.kappa(row)).unwrap_or(Cost::MAX)).collect();

    let state: Vec<f32> = rows.iter().flat_map(|&row| normaliser.apply(data.observation(row))).collect();
    let state = DMatrix::from_vec(data.state_dim(), rows.len(), state);
    let condition = |kappa: &Cost| match map {
        Some(map) => map.condition(*kappa),
        None => (f64::from(kappa.to_f32()) * cost_scale) as f32,
    };
    let condition: Vec<f32> = kappas.iter().map(condition).collect();
    let mut context = actor.denoiser.context(rows.len());
    actor.denoiser.prepare(parameters, &state, &condition, &mut context);
    let steps = actor.process.chain(Sampler::Ddpm, actor.process.schedule.steps);
    let mut chain = Chain::new(&actor.denoiser, steps, rows.len(), 0);
    chain.run(&actor.denoiser, parameters, &context, &|stage, sample, out: &mut [f32]| {
        Noise::new(sample as u64).fill_normal(stage as u32, 0, out);
    });

    let mut differences = Vec::new();
    for (sample, (&row, &kappa)) in rows.iter().zip(&kappas).enumerate() {
        let mut controller = HostController::new(policy, CostLimit::from_cost(kappa), sample as u64)?;
        let step = controller.step(data.observation(row), 0.0);
        let trained = chain.action.column(sample);
        differences.extend(step.action.iter().zip(trained.iter()).map(|(flown, trained)| (flown - trained).abs()));
    }
    Ok(Agreement::new(&differences, rows.len()))
}
