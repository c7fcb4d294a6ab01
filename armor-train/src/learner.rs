//! The algorithm: one training step of ARMOR, top to bottom.

use armor_core::noise::{Noise, below};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::actor::ActorLoss;
use crate::batch::Batch;
use crate::config::Config;
use crate::critic::Task;
use crate::data::Dataset;
use crate::model::{Model, Optimisers, Parameters};
use crate::nn::{Scalar, dot};
use crate::normaliser::Normaliser;
use crate::reweight::counterfactual::Counterfactual;
use crate::reweight::{Refresh, Weights};
use crate::update::{CriticMetrics, Worker, update_actor, update_critic, update_target};
use crate::{pcgrad, stream};

/// Samples of a worker's share. A constant, so that the shares, and with them
/// the order of all sums, do not depend on the machine.
const SHARE: usize = 128;

/// A training run in memory.
pub struct Learner<'d, T: Scalar> {
    config: Config,
    data: &'d Dataset,
    normaliser: Normaliser,
    model: Model,
    noise: Noise,
    refresh: Refresh,
    counterfactual: Counterfactual,
    weights: Weights,
    state: LearnerState<T>,
    workers: Vec<Worker<T>>,
}

/// All that changes from step to step: what a checkpoint holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct LearnerState<T: Scalar> {
    /// Training steps done.
    pub step: u64,
    /// The networks.
    pub parameters: Parameters<T>,
    /// Their optimisers.
    pub optimisers: Optimisers<T>,
    /// `w_cf` of each transition; all 1 before the first refresh.
    pub counterfactual: Vec<f32>,
}

/// What one training step measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Metrics {
    /// The critic's update.
    pub critic: CriticMetrics,
    /// The actor's and the dual's update, means over the batch.
    pub actor: ActorLoss,
    /// Smallest and largest `Q_r` of the batch at the policy's actions.
    pub reward_range: [f64; 2],
    /// Smallest and largest `Q_cL` of the batch at the policy's actions.
    pub long_cost_range: [f64; 2],
    /// Euclidean norms of the gradients that the optimisers saw: critic, actor, dual.
    pub gradient_norms: [f64; 3],
}

impl<'d, T: Scalar> Learner<'d, T> {
    /// A fresh run on `data`, from the seed in `config`.
    pub fn new(config: Config, data: &'d Dataset) -> Self {
        let model = Model::new(&config, data.state_dim(), data.action_dim());
        let noise = Noise::new(config.seed);
        let parameters = model.initialise(noise);
        let state = LearnerState {
            step: 0,
            optimisers: Optimisers::new(&config, &parameters),
            parameters,
            counterfactual: vec![1.0; data.len()],
        };
        Self::resume(config, data, state)
    }

    /// A run that goes on from `state`, with the bits of one never stopped.
    ///
    /// `state` must come from a run with the same configuration and data.
    pub fn resume(config: Config, data: &'d Dataset, state: LearnerState<T>) -> Self {
        let model = Model::new(&config, data.state_dim(), data.action_dim());
        let shares = (0..config.batch).step_by(SHARE);
        let workers = shares.map(|first| Worker::new(&model, first, SHARE.min(config.batch - first))).collect();
        let mut weights = Weights::ones(data, config.limit as f32, config.beta);
        let refresh = Refresh { warmup: config.reweight_warmup, interval: config.reweight_interval };
        if state.step > refresh.warmup {
            weights.counterfactual.clone_from(&state.counterfactual);
            weights.combine([config.weight_min, config.weight_max]);
        }
        Self {
            data,
            normaliser: Normaliser::new(data, config.normalize_states),
            model,
            noise: Noise::new(config.seed),
            refresh,
            counterfactual: Counterfactual {
                perturbations: config.perturbations,
                sigma: config.sigma,
                max: config.weight_max,
                ema: config.reweight_ema,
            },
            weights,
            state,
            workers,
            config,
        }
    }

    /// One training step (sections 3.2 to 3.4).
    pub fn step(&mut self) -> Metrics {
        if self.refresh.is_due(self.state.step) {
            self.reweight();
        }
        self.gather();

        let (step, noise, batch) = (self.state.step, self.noise, self.config.batch);
        let chain = |first_stream: u32| {
            move |stage: usize, sample: usize, out: &mut [T]| {
                fill_normal(noise, first_stream + stage as u32, step * batch as u64 + sample as u64, out);
            }
        };
        let [a, b, c, _] = noise.words(stream::SURGERY, step, 0);
        let LearnerState { parameters, optimisers, .. } = &mut self.state;
        let (model, workers) = (&self.model, &mut self.workers);

        let orders = pcgrad::orders([a, b, c]);
        let (critic, critic_gradient) =
            update_critic(model, parameters, optimisers, workers, &chain(stream::TARGET_CHAIN), &orders);
        let (actor, [actor_gradient, dual_gradient]) =
            update_actor(model, parameters, optimisers, workers, &chain(stream::POLICY_CHAIN));
        update_target(parameters, self.config.target_rate);

        self.state.step += 1;
        let range = |task| range(self.workers.iter().flat_map(|worker| worker.policy_values(task)));
        Metrics {
            critic,
            actor,
            reward_range: range(Task::Reward),
            long_cost_range: range(Task::LongCost),
            gradient_norms: [critic_gradient, actor_gradient, dual_gradient].map(|g| dot(&g, &g).sqrt()),
        }
    }

    /// Draws a batch of uniform transitions with replacement, and the noise of behaviour cloning.
    fn gather(&mut self) {
        let (step, noise, batch) = (self.state.step, self.noise, self.config.batch as u64);
        let levels = self.config.diffusion_steps as u32;
        let source = Source { config: &self.config, data: self.data, normaliser: &self.normaliser };
        let (weights, rows) = (&self.weights.combined, self.data.len() as u32);
        self.workers.par_iter_mut().for_each(|worker| {
            for sample in 0..worker.batch.samples() {
                let place = worker.first + sample;
                let word = |stream| noise.words(stream, step, place as u32 / 4)[place % 4];
                let row = below(word(stream::ROWS), rows) as usize;
                source.fill(&mut worker.batch, sample, row);
                worker.batch.weight[sample] = T::of_f32(weights[row]);
                worker.levels[sample] = 1 + below(word(stream::LEVELS), levels) as usize;
                let mut column = worker.cloning.column_mut(sample);
                fill_normal(noise, stream::CLONING, step * batch + place as u64, column.as_mut_slice());
            }
        });
    }

    /// Refreshes the weights of all transitions (Eqs. 8 to 10).
    fn reweight(&mut self) {
        let (step, noise, rows) = (self.state.step, self.noise, self.data.len());
        let source = Source { config: &self.config, data: self.data, normaliser: &self.normaliser };
        let mut margins = vec![0.0f32; rows];
        margins.par_chunks_mut(SHARE).enumerate().for_each(|(share, margins)| {
            let first = share * SHARE;
            let mut batch = Batch::zeros(self.data.state_dim(), self.data.action_dim(), margins.len());
            for sample in 0..margins.len() {
                source.fill(&mut batch, sample, first + sample);
            }
            let mut margin = vec![T::zero(); margins.len()];
            let draw = |k: usize, sample: usize, out: &mut [T]| {
                let tick = step * rows as u64 + (first + sample) as u64;
                fill_normal(noise, stream::PERTURBATION + k as u32, tick, out);
            };
            let critic = (&self.model.critic, &self.state.parameters.critic[..]);
            let inputs = (&batch.state, &batch.kappa[..], &batch.action);
            let mut tape = self.model.critic.tape(margins.len());
            self.counterfactual.margins(critic, inputs, &draw, &mut tape, &mut margin);
            for (out, margin) in margins.iter_mut().zip(margin) {
                *out = margin.to_f64() as f32;
            }
        });
        for mini_batch in shuffled(rows, noise, step).chunks(self.config.batch) {
            self.counterfactual.update(&margins, mini_batch, &mut self.state.counterfactual);
        }
        self.weights.counterfactual.clone_from(&self.state.counterfactual);
        self.weights.combine([self.config.weight_min, self.config.weight_max]);
    }

    /// The effective configuration.
    pub const fn config(&self) -> &Config {
        &self.config
    }

    /// The networks' layouts.
    pub const fn model(&self) -> &Model {
        &self.model
    }

    /// How the networks see a state.
    pub const fn normaliser(&self) -> &Normaliser {
        &self.normaliser
    }

    /// The weights of all transitions.
    pub const fn weights(&self) -> &Weights {
        &self.weights
    }

    /// `lambda(kappa)` at budgets in units of recorded cost.
    pub fn lambda<const N: usize>(&self, kappas: [f64; N]) -> [f64; N] {
        let dual = &self.model.dual;
        let scaled = kappas.map(|kappa| T::of(kappa * self.config.cost_scale));
        let mut tape = dual.tape(N);
        dual.forward(&self.state.parameters.dual, &scaled, &mut tape);
        std::array::from_fn(|place| tape.lambda[place].to_f64())
    }

    /// Refreshes of the weights so far.
    pub const fn refreshes(&self) -> u64 {
        self.refresh.done(self.state.step)
    }

    /// All that changes from step to step.
    pub const fn state(&self) -> &LearnerState<T> {
        &self.state
    }
}

/// Recorded transitions as the networks see them.
struct Source<'a> {
    config: &'a Config,
    data: &'a Dataset,
    normaliser: &'a Normaliser,
}

impl Source<'_> {
    /// Copies transition `row` to column `sample`, normalised and scaled (O-4, O-5).
    fn fill<T: Scalar>(&self, batch: &mut Batch<T>, sample: usize, row: usize) {
        let data = self.data;
        let normalise = |column: &mut [T], state: &[f32]| {
            for (out, value) in column.iter_mut().zip(self.normaliser.apply(state)) {
                *out = T::of_f32(value);
            }
        };
        normalise(batch.state.column_mut(sample).as_mut_slice(), data.observation(row));
        normalise(batch.next_state.column_mut(sample).as_mut_slice(), data.next_observation(row));
        for (out, &action) in batch.action.column_mut(sample).iter_mut().zip(data.action(row)) {
            *out = T::of_f32(action);
        }
        let scaled = |value: f32, scale: f64| T::of(f64::from(value) * scale);
        batch.reward[sample] = scaled(data.reward(row), self.config.reward_scale);
        batch.cost[sample] = scaled(data.cost(row), self.config.cost_scale);
        batch.kappa[sample] = scaled(data.kappa(row), self.config.cost_scale);
        batch.next_kappa[sample] = scaled(data.kappa_next(row), self.config.cost_scale);
        batch.alive[sample] = if data.done(row) { T::zero() } else { T::one() };
    }
}

/// The smallest and the largest of some values.
fn range<T: Scalar>(values: impl Iterator<Item = T>) -> [f64; 2] {
    values
        .map(T::to_f64)
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
}

/// Standard normal draws of a stream and tick, as the controller would draw them.
fn fill_normal<T: Scalar>(noise: Noise, stream: u32, tick: u64, out: &mut [T]) {
    for (block, four) in (0..).zip(out.chunks_mut(4)) {
        for (value, draw) in four.iter_mut().zip(noise.normals(stream, tick, block)) {
            *value = T::of_f32(draw);
        }
    }
}

/// The numbers below `len` in a random order (Fisher and Yates).
fn shuffled(len: usize, noise: Noise, tick: u64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..len).collect();
    for last in (1..len).rev() {
        let [word, ..] = noise.words(stream::SHUFFLE, tick, last as u32);
        order.swap(last, below(word, last as u32 + 1) as usize);
    }
    order
}
