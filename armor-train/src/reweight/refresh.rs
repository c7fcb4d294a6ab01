//! The weights of a run, and their refresh over the whole data.

use armor_core::noise::Noise;
use rayon::prelude::*;

use super::counterfactual::Counterfactual;
use super::reference::Bounds;
use super::{Averaged, MarginMean, Refresh, Scales, Weights, trajectory};
use crate::batch::Batch;
use crate::config::Config;
use crate::critic::Critic;
use crate::data::Dataset;
use crate::learner::SHARE;
use crate::nn::{Scalar, soft_update};
use crate::source::Source;
use crate::stream;

/// Multi-scale reweighting as a configuration wants it.
pub struct Reweighting {
    refresh: Refresh,
    counterfactual: Counterfactual,
    bounds: Bounds,
    /// `[w_min, w_max]` of Eq. 10.
    clip: [f64; 2],
    scales: Scales,
    averaged: Averaged,
    /// Share of the new value in the moving average over refreshes.
    ema: f64,
    /// Share of the transitions that a refresh looks at.
    share: f64,
    /// Transitions over which margins have their mean (Eq. 9).
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
                ema: match config.reweight_averaged {
                    Averaged::Counterfactual => config.reweight_ema,
                    Averaged::Weight => 1.0,
                },
                twins: config.counterfactual_twins,
            },
            bounds: Bounds::new(
                data,
                config.counterfactual_reference,
                config.short_cost_discount,
                config.counterfactual_tolerance,
                config.cost_scale,
            ),
            clip: [config.weight_min, config.weight_max],
            scales: config.reweight,
            averaged: config.reweight_averaged,
            ema: config.reweight_ema,
            share: config.refresh_share,
            mini_batch: match config.margin_mean {
                MarginMean::Batch => config.batch,
                MarginMean::Data => data.len(),
            },
            weights: Weights::ones(data, config.limit as f32, beta(config, data)),
        }
    }

    /// The weights that followed from what the moving average kept of an earlier refresh,
    /// which raised the share `active`.
    pub fn restore(&mut self, data: &Dataset, averaged: &[f32], active: f64) {
        self.weights.active = active;
        match self.averaged {
            Averaged::Counterfactual => self.weights.combine(data, averaged, self.clip),
            Averaged::Weight => self.weights.combined.copy_from_slice(averaged),
        }
    }

    /// Whether a refresh is due before training step `step`, counted from 0.
    pub fn is_due(&self, step: u64) -> bool {
        self.scales != Scales::Off && self.refresh.is_due(step)
    }

    /// Refreshes before `steps` training steps were done.
    pub fn refreshes(&self, steps: u64) -> u64 {
        if self.scales == Scales::Off { 0 } else { self.refresh.done(steps) }
    }

    /// Whether step number `steps`, counted from 1, is trained with the weights as they shall be.
    pub fn is_in_use(&self, steps: u64) -> bool {
        self.scales == Scales::Off || self.refresh.done(steps) > 0
    }

    /// The weights of all transitions.
    pub const fn weights(&self) -> &Weights {
        &self.weights
    }

    /// Eqs. 8 to 10 with the given critic; moves what the moving average keeps of all
    /// transitions, and returns the share of them whose `w_cf` it raised.
    pub(crate) fn refresh<T: Scalar>(
        &mut self,
        source: &Source<'_>,
        critic: (&Critic, &[T]),
        (noise, step): (Noise, u64),
        averaged: &mut [f32],
    ) -> f64 {
        let rows = averaged.len();
        let mut active = 0;
        let mut fresh = match self.averaged {
            Averaged::Counterfactual => Vec::new(),
            Averaged::Weight => vec![1.0; rows],
        };
        let counterfactual = match self.averaged {
            Averaged::Counterfactual => &mut *averaged,
            Averaged::Weight => &mut fresh,
        };
        if self.scales.counterfactual() {
            let mut looked_at = stream::shuffled(rows as u32, noise, step);
            looked_at.truncate((self.share * rows as f64).ceil() as usize);
            // The weights are made anew below: until then the margins stand in their memory.
            let mut margins = std::mem::take(&mut self.weights.combined);
            self.margins(source, critic, (noise, step), &looked_at, &mut margins);
            for mini_batch in looked_at.chunks(self.mini_batch) {
                self.counterfactual.update(&margins, mini_batch, counterfactual);
            }
            active = margins.iter().filter(|margin| **margin > 0.0).count();
            self.weights.combined = margins;
        }
        let active = active as f64 / rows as f64;
        if self.averaged == Averaged::Weight {
            self.weights.combine(source.data(), &fresh, self.clip);
            soft_update(averaged, &self.weights.combined, self.ema as f32);
        }
        self.restore(source.data(), averaged, active);
        active
    }

    /// Writes the margins of Eq. 8 of all transitions; 0 for those that are not looked at.
    fn margins<T: Scalar>(
        &self,
        source: &Source<'_>,
        critic: (&Critic, &[T]),
        (noise, step): (Noise, u64),
        looked_at: &[u32],
        margins: &mut [f32],
    ) {
        let rows = margins.len();
        margins.fill(0.0);
        let mut wanted = vec![false; rows];
        looked_at.iter().for_each(|&row| wanted[row as usize] = true);
        let shares = wanted.par_chunks(SHARE).zip(margins.par_chunks_mut(SHARE)).enumerate();
        shares.for_each(|(index, (wanted, margins))| {
            let share = (index * SHARE..).zip(wanted).filter(|(_, wanted)| **wanted).map(|(row, _)| row);
            let share: Vec<usize> = share.collect();
            let mut batch: Batch<T> = source.room(share.len());
            for (sample, &row) in share.iter().enumerate() {
                source.fill(&mut batch, sample, row, 0.0);
            }
            let bound = share.iter().map(|&row| T::of(self.bounds.bound(source.data(), row)));
            let bound: Vec<T> = bound.collect();
            let draw = |k: usize, sample: usize, out: &mut [T]| {
                let tick = step * rows as u64 + share[sample] as u64;
                stream::fill_normal(noise, stream::PERTURBATION + k as u32, tick, out);
            };
            let inputs = (&batch.state, &batch.kappa[..], &batch.action);
            let mut tape = critic.0.tape(share.len());
            let mut margin = vec![T::zero(); share.len()];
            self.counterfactual.margins(critic, inputs, &bound, &draw, &mut tape, &mut margin);
            for (row, margin) in share.into_iter().zip(margin) {
                margins[row % SHARE] = margin.to_f64() as f32;
            }
        });
    }
}

/// 0 where trajectories are not weighted, else the configured beta of Eq. 6, or the one that gives feasible trajectories the configured mass.
fn beta(config: &Config, data: &Dataset) -> f64 {
    if !config.reweight.trajectory() {
        return 0.0;
    }
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
mod tests;
