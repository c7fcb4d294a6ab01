//! The weights of a run, and their refresh over the whole data.

use armor_core::noise::Noise;
use rayon::prelude::*;

use super::counterfactual::Counterfactual;
use super::reference::Bounds;
use super::{Refresh, Weights, trajectory};
use crate::batch::Batch;
use crate::config::Config;
use crate::critic::Critic;
use crate::data::Dataset;
use crate::learner::SHARE;
use crate::nn::Scalar;
use crate::source::Source;
use crate::stream;

/// Multi-scale reweighting as a configuration wants it.
pub struct Reweighting {
    refresh: Refresh,
    counterfactual: Counterfactual,
    bounds: Bounds,
    /// `[w_min, w_max]` of Eq. 10.
    clip: [f64; 2],
    /// Transitions of a mini-batch of Eq. 9.
    mini_batch: usize,
    weights: Weights,
}

impl Reweighting {
    /// All weights 1.
    pub fn new(config: &Config, data: &Dataset) -> Self {
        Self {
            // While the critics train alone nobody is weighed.
            refresh: Refresh {
                warmup: config.reweight_warmup.max(config.critic_steps),
                interval: config.reweight_interval,
            },
            counterfactual: Counterfactual {
                perturbations: config.perturbations,
                sigma: sigma(config, data),
                max: config.weight_max,
                ema: config.reweight_ema,
            },
            bounds: Bounds::new(
                data,
                config.counterfactual_reference,
                config.short_cost_discount,
                config.counterfactual_tolerance,
                config.cost_scale,
            ),
            clip: [config.weight_min, config.weight_max],
            mini_batch: config.batch,
            weights: Weights::ones(data, config.limit as f32, beta(config, data)),
        }
    }

    /// The weights that followed from counterfactual weights of an earlier refresh.
    pub fn restore(&mut self, counterfactual: &[f32]) {
        self.weights.counterfactual.copy_from_slice(counterfactual);
        self.weights.combine(self.clip);
    }

    /// Whether a refresh is due before training step `step`, counted from 0.
    pub const fn is_due(&self, step: u64) -> bool {
        self.refresh.is_due(step)
    }

    /// Refreshes before `steps` training steps were done.
    pub const fn refreshes(&self, steps: u64) -> u64 {
        self.refresh.done(steps)
    }

    /// The weights of all transitions.
    pub const fn weights(&self) -> &Weights {
        &self.weights
    }

    /// Eqs. 8 to 10 with the live critic; moves `counterfactual`, `w_cf` of all transitions.
    pub(crate) fn refresh<T: Scalar>(
        &mut self,
        source: &Source<'_>,
        (critic, parameters): (&Critic, &[T]),
        (noise, step): (Noise, u64),
        counterfactual: &mut [f32],
    ) {
        let rows = counterfactual.len();
        let mut margins = vec![0.0f32; rows];
        margins.par_chunks_mut(SHARE).enumerate().for_each(|(share, margins)| {
            let first = share * SHARE;
            let mut batch: Batch<T> = source.room(margins.len());
            for sample in 0..margins.len() {
                source.fill(&mut batch, sample, first + sample, 0.0);
            }
            let bound: Vec<T> = (first..first + margins.len()).map(|row| T::of(self.bounds.bound(row))).collect();
            let draw = |k: usize, sample: usize, out: &mut [T]| {
                let tick = step * rows as u64 + (first + sample) as u64;
                stream::fill_normal(noise, stream::PERTURBATION + k as u32, tick, out);
            };
            let inputs = (&batch.state, &batch.kappa[..], &batch.action);
            let mut tape = critic.tape(margins.len());
            let mut margin = vec![T::zero(); margins.len()];
            self.counterfactual.margins((critic, parameters), inputs, &bound, &draw, &mut tape, &mut margin);
            for (out, margin) in margins.iter_mut().zip(margin) {
                *out = margin.to_f64() as f32;
            }
        });
        for mini_batch in stream::shuffled(rows, noise, step).chunks(self.mini_batch) {
            self.counterfactual.update(&margins, mini_batch, counterfactual);
        }
        self.restore(counterfactual);
    }
}

/// The configured beta of Eq. 6, or the one that gives feasible trajectories the configured mass.
fn beta(config: &Config, data: &Dataset) -> f64 {
    if config.feasible_mass == 0.0 {
        return config.beta;
    }
    let feasible = data.trajectories().iter().filter(|trajectory| f64::from(trajectory.cost_return) <= config.limit);
    let p = feasible.count() as f64 / data.trajectories().len().max(1) as f64;
    trajectory::beta_for_mass(p, config.feasible_mass)
}

/// The standard deviation of a perturbation, for each action entry.
fn sigma(config: &Config, data: &Dataset) -> Vec<f64> {
    let entries = 0..data.action_dim();
    if !config.sigma_per_entry {
        return entries.map(|_| config.sigma).collect();
    }
    let rows = data.len() as f64;
    let values = |entry: usize| (0..data.len()).map(move |row| f64::from(data.action(row)[entry]));
    let deviation = |entry| {
        let mean = values(entry).sum::<f64>() / rows;
        (values(entry).map(|value| (value - mean).powi(2)).sum::<f64>() / rows).sqrt()
    };
    entries.map(|entry| config.sigma * deviation(entry)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Preset;
    use crate::testing::dataset;

    #[test]
    fn a_feasible_mass_replaces_beta() {
        let mut config = Preset::Paper.config("own", 1.0);
        assert_eq!(beta(&config, &dataset()), 0.5);
        // One of the two trajectories is feasible, so a mass of 0.8 is 1 + beta = 4.
        config.feasible_mass = 0.8;
        assert!((beta(&config, &dataset()) - 3.0).abs() < 1e-12);
    }

    #[test]
    fn sigma_counts_in_deviations_where_asked() {
        let mut config = Preset::Paper.config("own", 1.0);
        assert_eq!(sigma(&config, &dataset()), [0.1]);
        config.sigma_per_entry = true;
        // The actions are 0.1 .. 0.6.
        let expected = 0.1 * 0.1 * (35.0f64 / 12.0).sqrt();
        assert!((sigma(&config, &dataset())[0] - expected).abs() < 1e-8);
    }
}
