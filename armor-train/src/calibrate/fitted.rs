//! Fitted Q evaluation of cost (Le et al. 2019), of all policies of a family at once.
//!
//! ```text
//! y    = c + gamma_cL alive Q^-(s', a', x)        a' ~ pi(. | s', x)
//! J(x) = mean over starts of Q(s_0, a_0, x) / ratio(gamma_cL, T)
//! ```
//!
//! One network learns the discounted cost of every leniency `x`, which is drawn
//! for each sample. The discounted cost of an episode becomes its whole cost as
//! if it were incurred evenly over the `T` steps of the longest recorded one
//! ([`ratio`]).

use armor_core::noise::{Noise, below, uniform};
use armor_core::schedule::Sampler;
use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::actor::Actor;
use crate::actor::chain::Chain;
use crate::actor::denoiser::Context;
use crate::batch::Batch;
use crate::config::Config;
use crate::data::Dataset;
use crate::learner::SHARE;
use crate::nn::{Activation, Adam, Mlp, Tape, accumulate, soft_update};
use crate::source::Source;
use crate::stream;
use crate::threshold::ratio;

/// Steps of the sampler of next actions, DDIM.
const SAMPLER_STEPS: usize = 5;
/// Learning rate, Adam.
const RATE: f64 = 1e-3;
/// Soft update of the target network: a fixed policy is evaluated, which bears a faster one than learning does.
const TARGET_RATE: f32 = 0.05;
/// Starts of recorded trajectories over which the cost of an episode is averaged.
const STARTS: usize = 512;

/// A policy family to be judged on recorded data.
pub(crate) struct Evaluation<'a> {
    pub(crate) config: &'a Config,
    pub(crate) actor: (&'a Actor, &'a [f32]),
    pub(crate) data: &'a Dataset,
    pub(crate) source: Source<'a>,
}

/// The network, `[s; a; x] -> Q`, and its target.
struct Fit {
    network: Mlp,
    live: Vec<f32>,
    target: Vec<f32>,
}

/// A share of the batch.
struct Worker {
    first: usize,
    batch: Batch<f32>,
    leniency: Vec<f32>,
    context: Context<f32>,
    chain: Chain<f32>,
    input: DMatrix<f32>,
    next_input: DMatrix<f32>,
    tape: Tape<f32>,
    gradient: Vec<f32>,
}

impl Evaluation<'_> {
    /// `J` in units of recorded cost at each leniency, after `steps` steps of fitting.
    ///
    /// `watch` is called after every step with the steps done. The numbers
    /// depend on the configuration's seed alone, not on the number of threads.
    pub(crate) fn costs(&self, leniencies: &[f64], steps: u64, mut watch: impl FnMut(u64)) -> Vec<f64> {
        let (config, data) = (self.config, self.data);
        let inputs = data.state_dim() + data.action_dim() + 1;
        let network = Mlp::new(&[inputs, config.trunk, config.trunk, 1], 0, Activation::Mish, None);
        let noise = Noise::new(config.seed);
        let mut live = vec![0.0; network.end()];
        let words = (0..).flat_map(|block| noise.words(stream::EVALUATION_START, 0, block));
        network.initialise(&mut live, &mut words.map(|word| f64::from(uniform(word))));
        let mut fit = Fit { target: live.clone(), live, network };
        let mut adam = Adam::new(fit.live.len(), RATE);
        let shares = (0..config.batch).step_by(SHARE);
        let mut workers: Vec<Worker> =
            shares.map(|first| self.worker(&fit, first, SHARE.min(config.batch - first))).collect();
        for step in 0..steps {
            workers.par_iter_mut().for_each(|worker| self.fit_share(&fit, worker, (noise, step)));
            let mut gradient = vec![0.0; fit.live.len()];
            for worker in &workers {
                accumulate(&mut gradient, &worker.gradient);
            }
            adam.descend(&mut fit.live, &gradient);
            soft_update(&mut fit.target, &fit.live, TARGET_RATE);
            watch(step + 1);
        }
        self.at_starts(&fit, leniencies, noise)
    }

    fn worker(&self, fit: &Fit, first: usize, samples: usize) -> Worker {
        let (actor, _) = self.actor;
        let steps = actor.process.chain(Sampler::Ddim, SAMPLER_STEPS.min(actor.process.schedule.steps));
        let inputs = self.data.state_dim() + self.data.action_dim() + 1;
        Worker {
            first,
            batch: self.source.room(samples),
            leniency: vec![0.0; samples],
            context: actor.denoiser.context(samples),
            chain: Chain::new(&actor.denoiser, steps, samples, 0),
            input: DMatrix::zeros(inputs, samples),
            next_input: DMatrix::zeros(inputs, samples),
            tape: fit.network.tape(samples),
            gradient: vec![0.0; fit.live.len()],
        }
    }

    /// Draws a share of transitions and leniencies, and computes its gradient.
    fn fit_share(&self, fit: &Fit, worker: &mut Worker, (noise, step): (Noise, u64)) {
        let (config, rows) = (self.config, self.data.len() as u32);
        for sample in 0..worker.batch.samples() {
            let place = worker.first + sample;
            let word = |stream| noise.words(stream, step, place as u32 / 4)[place % 4];
            let row = below(word(stream::EVALUATION_ROWS), rows) as usize;
            self.source.fill(&mut worker.batch, sample, row, 0.0);
            worker.leniency[sample] = uniform(word(stream::EVALUATION_LENIENCY));
        }
        let tick = step * config.batch as u64 + worker.first as u64;
        let Worker { batch, leniency, context, chain, input, next_input, tape, gradient, .. } = worker;
        self.act(&batch.next_state, leniency, (context, chain), (noise, tick));
        fill(next_input, &batch.next_state, &chain.action, leniency);
        fit.network.forward(&fit.target, next_input, tape, false);
        let pairs = batch.cost.iter().zip(&batch.alive).zip(tape.output().iter());
        let discount = config.long_cost_discount as f32;
        let targets: Vec<f32> = pairs.map(|((cost, alive), next)| cost + discount * alive * next).collect();

        fill(input, &batch.state, &batch.action, leniency);
        fit.network.forward(&fit.live, input, tape, true);
        let share = 2.0 / config.batch as f32;
        for (sample, target) in targets.into_iter().enumerate() {
            tape.output_gradient()[sample] = share * (tape.output()[sample] - target);
        }
        gradient.fill(0.0);
        fit.network.backward(&fit.live, input, tape, Some(gradient), None);
    }

    /// Samples the policy's actions at states `S x B` and leniencies `[B]`.
    fn act(
        &self,
        state: &DMatrix<f32>,
        leniency: &[f32],
        (context, chain): (&mut Context<f32>, &mut Chain<f32>),
        (noise, tick): (Noise, u64),
    ) {
        let (actor, parameters) = self.actor;
        actor.denoiser.prepare(parameters, state, leniency, context);
        chain.run(&actor.denoiser, parameters, context, &|stage, sample, out: &mut [f32]| {
            stream::fill_normal(noise, stream::EVALUATION_CHAIN + stage as u32, tick + sample as u64, out);
        });
    }

    /// The mean cost of an episode from recorded starts, at each leniency.
    fn at_starts(&self, fit: &Fit, leniencies: &[f64], noise: Noise) -> Vec<f64> {
        let trajectories = self.data.trajectories();
        let stride = trajectories.len().div_ceil(STARTS).max(1);
        let starts: Vec<usize> = trajectories.iter().step_by(stride).map(|trajectory| trajectory.rows.start).collect();
        let horizon = trajectories.iter().map(|trajectory| trajectory.rows.len()).max().unwrap_or(1);
        let scale = ratio(self.config.long_cost_discount, horizon) * self.config.cost_scale;
        let mut worker = self.worker(fit, 0, starts.len());
        for (sample, &row) in starts.iter().enumerate() {
            self.source.fill(&mut worker.batch, sample, row, 0.0);
        }
        let Worker { batch, leniency, context, chain, input, tape, .. } = &mut worker;
        let mut cost = |value: &f64| {
            leniency.fill(*value as f32);
            // Past every tick of the fit.
            self.act(&batch.state, leniency, (context, chain), (noise, u64::MAX / 2));
            fill(input, &batch.state, &chain.action, leniency);
            fit.network.forward(&fit.live, input, tape, false);
            let sum: f64 = tape.output().iter().map(|&cost| f64::from(cost)).sum();
            (sum / starts.len() as f64 / scale).max(0.0)
        };
        leniencies.iter().map(&mut cost).collect()
    }
}

/// `[s; a; x]`, column by column.
fn fill(input: &mut DMatrix<f32>, state: &DMatrix<f32>, action: &DMatrix<f32>, leniency: &[f32]) {
    input.rows_mut(0, state.nrows()).copy_from(state);
    input.rows_mut(state.nrows(), action.nrows()).copy_from(action);
    let last = input.nrows() - 1;
    for (input, &leniency) in input.row_mut(last).iter_mut().zip(leniency) {
        *input = leniency;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Preset;
    use crate::extraction::condition::Condition;
    use crate::model::Model;
    use crate::normaliser::Normaliser;
    use crate::testing::recording;

    fn costs(cost: impl Fn(usize) -> f32, threads: usize) -> Vec<f64> {
        let data = recording(6, 20, |_| 0.0, cost);
        let mut config = Preset::Quick.config("own", 1.0);
        (config.condition, config.batch, config.trunk, config.hidden) = (Condition::Lambda, 160, 16, 8);
        config.cost_scale = 0.5;
        let normaliser = Normaliser::new(&data, true);
        let model = Model::new(&config, data.state_dim(), data.action_dim());
        let parameters = model.initialise::<f32>(Noise::new(1));
        let evaluation = Evaluation {
            config: &config,
            actor: (&model.actor, &parameters.actor),
            data: &data,
            source: Source::new(&config, &data, &normaliser),
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| evaluation.costs(&[0.0, 1.0], 1500, |_| ()))
    }

    /// Whatever the policy does, an episode of 20 steps costs 20; the state does not tell the time, so the
    /// value is a mean over the episode's steps, which lies between that of one step and that of all.
    #[test]
    fn a_cost_of_one_at_every_step_is_found() {
        let found = costs(|_| 1.0, 2);
        assert!(found.iter().all(|cost| (8.0..22.0).contains(cost)), "{found:?}");
        assert!(costs(|_| 0.0, 2).iter().all(|cost| *cost < 0.5));
    }

    #[test]
    fn the_estimate_does_not_depend_on_the_number_of_threads() {
        assert_eq!(costs(|row| (row % 2) as f32, 1), costs(|row| (row % 2) as f32, 3));
    }
}
