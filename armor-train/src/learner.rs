//! The algorithm: one training step of ARMOR, top to bottom.

mod gather;
mod judgement;
mod state;

use std::sync::Arc;

use armor_core::noise::Noise;

use crate::actor::ActorLoss;
use crate::config::Config;
use crate::critic::Task;
use crate::data::Dataset;
use crate::extraction::Extraction;
use crate::extraction::advantage::Advantages;
use crate::extraction::cloning::Cloning;
use crate::extraction::weight::{self, BatchWeights};
use crate::model::{ActorCopy, Model, Optimisers};
use crate::nn::{Scalar, dot, soft_update};
use crate::normaliser::Normaliser;
use crate::pcgrad::{self, Order};
use crate::phase::Phase;
use crate::reweight::{Reweighting, Weights};
use crate::sampling::Rows;
use crate::selection::{Choice, Selection};
use crate::source::Source;
use crate::stream;
use crate::update::{CriticMetrics, Worker, update_actor, update_critic, update_imitation, update_target};

pub use state::LearnerState;

/// Samples of a worker's share. A constant, so that the shares, and with them
/// the order of all sums, do not depend on the machine; a multiple of the
/// columns of a product's tile.
pub(crate) const SHARE: usize = 132;
/// The tasks whose values are measured.
const VALUES: [Task; 2] = [Task::Reward, Task::LongCost];

/// A training run in memory.
pub struct Learner<'d, T: Scalar> {
    config: Config,
    data: &'d Dataset,
    normaliser: Normaliser,
    rows: Rows,
    model: Model,
    noise: Noise,
    reweighting: Reweighting,
    /// By the frozen critics; none before they are, or where the actor is guided.
    cloning: Option<Cloning>,
    state: LearnerState<T>,
    workers: Vec<Worker<T>>,
}

/// What one training step measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Metrics {
    /// The critic's update; none where it is frozen.
    pub critic: Option<CriticMetrics>,
    /// The actor's and the dual's update, means over the batch; none before the critics are trained.
    pub actor: Option<ActorLoss>,
    /// The weights of the batch, where the actor clones by advantage.
    pub batch_weights: Option<BatchWeights>,
    /// Smallest, mean and largest `Q_r` and `Q_cL` of the batch, at the policy's actions, or at the
    /// recorded ones where the critics train alone; none where no critic was asked.
    pub values: Option<[[f64; 3]; 2]>,
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
            counterfactual_active: 0.0,
            selection: Selection::new(),
        };
        Self::resume(config, data, state)
    }

    /// A run that goes on from `state`, with the bits of one never stopped.
    ///
    /// `state` must come from a run with the same configuration and data.
    pub fn resume(config: Config, data: &'d Dataset, state: LearnerState<T>) -> Self {
        let model = Model::new(&config, data.state_dim(), data.action_dim());
        let shares = (0..config.batch).step_by(SHARE);
        let rooms = Arc::default();
        let worker = |first| Worker::new(&model, first, SHARE.min(config.batch - first), Arc::clone(&rooms));
        let workers = shares.map(worker).collect();
        let mut reweighting = Reweighting::new(&config, data);
        if reweighting.refreshes(state.step) > 0 {
            reweighting.restore(data, &state.counterfactual, state.counterfactual_active);
        }
        Self {
            data,
            normaliser: Normaliser::new(data, config.normalize_states),
            rows: Rows::new(config.sampling, data),
            model,
            noise: Noise::new(config.seed),
            reweighting,
            cloning: None,
            state,
            workers,
            config,
        }
    }

    /// One training step (sections 3.2 to 3.4).
    pub fn step(&mut self) -> Metrics {
        let phase = Phase::of(&self.config, self.state.step);
        if self.reweighting.is_due(self.state.step) {
            self.reweight();
        }
        if phase == Phase::Actor && self.cloning.is_none() {
            self.cloning = self.judge_data();
        }
        self.gather();

        let (step, noise, batch) = (self.state.step, self.noise, self.config.batch);
        let chain = |first_stream: u32| {
            move |stage: usize, sample: usize, out: &mut [T]| {
                stream::fill_normal(noise, first_stream + stage as u32, step * batch as u64 + sample as u64, out);
            }
        };
        let [a, b, c, _] = match self.config.pcgrad {
            Order::Random => noise.words(stream::SURGERY, step, 0),
            Order::Fixed | Order::Off => [0; 4],
        };
        let LearnerState { parameters, optimisers, .. } = &mut self.state;
        let (model, workers) = (&self.model, &mut self.workers);

        optimisers.schedule(&self.config, step);
        let mut metrics = Metrics::default();
        if phase.trains_critics() {
            let orders = pcgrad::orders([a, b, c]);
            let draw = chain(stream::TARGET_CHAIN);
            let (critic, gradient) = update_critic(model, parameters, optimisers, workers, &draw, &orders);
            metrics.critic = Some(critic);
            metrics.gradient_norms[0] = dot(&gradient, &gradient).sqrt();
            update_target(parameters, self.config.target_rate);
        }
        if phase == Phase::Critics {
            metrics.values = Some(VALUES.map(|task| spread(workers.iter().flat_map(|w| w.recorded_values(task)))));
        }
        if phase.trains_actor() {
            let gradients = if self.cloning.is_some() {
                let mut shares: Vec<&mut [T]> = workers.iter_mut().map(|worker| &mut worker.batch.weight[..]).collect();
                metrics.batch_weights = Some(weight::normalise(&mut shares));
                let (cloning, gradient) = update_imitation(model, parameters, optimisers, workers);
                metrics.actor = Some(ActorLoss { cloning, ..ActorLoss::default() });
                [gradient, Vec::new()]
            } else {
                let draw = chain(stream::POLICY_CHAIN);
                let (actor, gradients) = update_actor(model, parameters, optimisers, workers, &draw);
                metrics.actor = Some(actor);
                metrics.values = Some(VALUES.map(|task| spread(workers.iter().flat_map(|w| w.policy_values(task)))));
                gradients
            };
            [metrics.gradient_norms[1], metrics.gradient_norms[2]] = gradients.map(|g| dot(&g, &g).sqrt());
            let average_rate = T::of(1.0 - self.config.actor_average);
            soft_update(&mut parameters.actor_average, &parameters.actor, average_rate);
        }
        if self.config.weight_decay > 0.0 {
            optimisers.shrink(parameters, self.config.weight_decay, [phase.trains_critics(), phase.trains_actor()]);
        }
        self.state.step += 1;
        self.select(&metrics);
        metrics
    }

    /// Looks at the cloning loss of a step, where it decides which actor flies. Losses before
    /// the weights are in use are of another data set.
    fn select(&mut self, metrics: &Metrics) {
        let (Choice::CloningLoss, Some(actor)) = (self.config.selection, metrics.actor) else { return };
        if self.reweighting.is_in_use(self.state.step) {
            let LearnerState { parameters, selection, .. } = &mut self.state;
            selection.push(actor.cloning, parameters.actor_copy(ActorCopy::Average));
        }
    }

    /// Refreshes the weights of all transitions (Eqs. 8 to 10).
    fn reweight(&mut self) {
        let source = Source::new(&self.config, self.data, &self.normaliser);
        let parameters = &self.state.parameters;
        let critic = (&self.model.critic, parameters.critic_copy(self.config.counterfactual_critic));
        let (step, counterfactual) = (self.state.step, &mut self.state.counterfactual);
        self.state.counterfactual_active =
            self.reweighting.refresh(&source, critic, (self.noise, step), counterfactual);
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
        self.reweighting.weights()
    }

    /// Whether the dual learns in this run: it does where the actor is guided.
    pub fn trains_dual(&self) -> bool {
        self.config.extraction == Extraction::Guidance
    }

    /// `lambda(kappa)` at budgets in units of recorded cost.
    pub fn lambda<const N: usize>(&self, kappas: [f64; N]) -> [f64; N] {
        let dual = &self.model.dual;
        let scaled = kappas.map(|kappa| T::of(kappa * self.config.cost_scale));
        let mut tape = dual.tape(N);
        dual.forward(&self.state.parameters.dual, &scaled, &mut tape);
        std::array::from_fn(|place| tape.lambda[place].to_f64())
    }

    /// The advantages that the actor clones by, once the critics are frozen.
    pub fn advantages(&self) -> Option<&Advantages> {
        self.cloning.as_ref().map(Cloning::advantages)
    }

    /// Refreshes of the weights so far.
    pub fn refreshes(&self) -> u64 {
        self.reweighting.refreshes(self.state.step)
    }

    /// All that changes from step to step.
    pub const fn state(&self) -> &LearnerState<T> {
        &self.state
    }
}

/// The smallest, the mean and the largest of some values.
fn spread<T: Scalar>(values: impl Iterator<Item = T>) -> [f64; 3] {
    let (mut low, mut high, mut sum, mut count) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0);
    for value in values.map(T::to_f64) {
        (low, high, sum, count) = (low.min(value), high.max(value), sum + value, count + 1.0);
    }
    [low, sum / count, high]
}

#[cfg(test)]
mod tests;
