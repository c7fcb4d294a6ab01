//! Drawing the batch of a training step.

use armor_core::noise::{below, uniform};
use rayon::prelude::*;

use super::Learner;
use crate::extraction::cloning::Cloning;
use crate::extraction::condition::Condition;
use crate::nn::Scalar;
use crate::reweight::{self, WeightMean};
use crate::source::Source;
use crate::stream;

impl<T: Scalar> Learner<'_, T> {
    /// Draws a batch of transitions with replacement, and the noise of behaviour cloning.
    ///
    /// Weights are those of Eq. 10; where there are advantages, their logarithm plus that of the advantage weight.
    pub(super) fn gather(&mut self) {
        let (step, noise, batch) = (self.state.step, self.noise, self.config.batch as u64);
        let levels = self.config.diffusion_steps as u32;
        let source = Source::new(&self.config, self.data, &self.normaliser);
        let (cloning, condition) = (self.cloning.as_ref(), self.config.condition);
        let weights = self.reweighting.weights();
        let rows = cloning.and_then(Cloning::followed).unwrap_or(&self.rows);
        let spread = cloning.map_or(0.0, |_| self.config.state_noise);
        let by_batch = self.config.weight_mean == WeightMean::Batch && self.reweighting.is_in_use(step + 1);
        let counterfactual = &self.state.counterfactual;
        let weight = |row: usize| match by_batch {
            true => weights.product(self.data, counterfactual, row),
            false => f64::from(weights.combined[row]),
        };
        let [twin, ..] = noise.words(stream::TWINS, step, 0);
        self.workers.par_iter_mut().for_each(|worker| {
            worker.second_twin = twin & 1 == 1;
            for sample in 0..worker.batch.samples() {
                let place = worker.first + sample;
                let tick = step * batch + place as u64;
                let word = |stream| noise.words(stream, step, place as u32 / 4)[place % 4];
                let row = rows.draw(word);
                let extra = source.larger_budget(row, word(stream::BUDGET), word(stream::RELABEL));
                source.fill(&mut worker.batch, sample, row, extra);
                if spread > 0.0 {
                    let mut state = worker.batch.state.column_mut(sample);
                    stream::add_normal(noise, stream::STATE_NOISE, tick, spread, state.as_mut_slice());
                }
                let leniency = uniform(word(stream::LENIENCY));
                worker.batch.weight[sample] = match cloning {
                    None => T::of(weight(row)),
                    Some(cloning) => T::of(weight(row).ln() + cloning.log_weight(row, f64::from(leniency))),
                };
                match condition {
                    Condition::Kappa => {}
                    Condition::Lambda => worker.batch.condition[sample] = T::of_f32(leniency),
                    Condition::None => worker.batch.condition[sample] = T::zero(),
                }
                worker.levels[sample] = 1 + below(word(stream::LEVELS), levels) as usize;
                let mut column = worker.cloning.column_mut(sample);
                stream::fill_normal(noise, stream::CLONING, tick, column.as_mut_slice());
            }
        });
        if by_batch {
            let mut shares: Vec<&mut [T]> =
                self.workers.iter_mut().map(|worker| &mut worker.batch.weight[..]).collect();
            reweight::normalise(&mut shares, [self.config.weight_min, self.config.weight_max]);
        }
    }
}
