//! A share of the batch, and what is computed from it.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::judging::{self, Judgement, Networks};
use crate::actor::chain::{Chain, Draw};
use crate::actor::{ActorLoss, ActorNoise, ActorTape, Judges};
use crate::batch::Batch;
use crate::critic::Task;
use crate::critic::bootstrap::InSample;
use crate::model::Model;
use crate::nn::{Scalar, Weights};
use crate::pool::Pool;

/// A share of the batch, and room for everything that is computed from it.
#[derive(Debug)]
pub struct Worker<T: Scalar> {
    /// Place of the share's first sample in the batch.
    pub first: usize,
    /// The share.
    pub batch: Batch<T>,
    /// Noise level of each sample for behaviour cloning.
    pub levels: Vec<usize>,
    /// Noise of behaviour cloning, `A x B`.
    pub cloning: DMatrix<T>,
    /// Whether the second of the critic's twins judges the actor, where that is random.
    pub second_twin: bool,
    rooms: Arc<Rooms<T>>,
    /// Where targets bootstrap from state values.
    pub(super) in_sample: Option<InSample<T>>,
    pub(super) judgement: Judgement<T>,
    actor_tape: ActorTape<T>,
    pub(super) actor_gradient: Vec<T>,
    pub(super) dual_gradient: Vec<T>,
    pub(super) actor_loss: ActorLoss,
}

/// Room that all shares of a batch have in common.
#[derive(Debug)]
pub struct Rooms<T: Scalar> {
    judging: Pool<judging::Room<T>>,
    chains: Arc<Pool<Chain<T>>>,
}

impl<T: Scalar> Default for Rooms<T> {
    fn default() -> Self {
        Self { judging: Pool::default(), chains: Arc::default() }
    }
}

impl<T: Scalar> Worker<T> {
    /// Room for a share of `samples` samples from place `first` on, and `rooms` that all shares have in common.
    pub fn new(model: &Model, first: usize, samples: usize, rooms: Arc<Rooms<T>>) -> Self {
        let denoiser = &model.actor.denoiser;
        let (state, action) = (denoiser.widths().state, denoiser.widths().action);
        Self {
            first,
            batch: Batch::zeros(state, action, samples),
            levels: vec![1; samples],
            cloning: DMatrix::zeros(action, samples),
            second_twin: false,
            in_sample: model.state_value.as_ref().map(|value| InSample::new(value, samples)),
            judgement: Judgement::new(model, samples),
            actor_tape: model.actor.tape(&model.critic, &model.dual, samples, Arc::clone(&rooms.chains)),
            actor_gradient: vec![T::zero(); denoiser.size()],
            dual_gradient: vec![T::zero(); model.dual.size()],
            actor_loss: ActorLoss::default(),
            rooms,
        }
    }

    /// The actions that the actor's last update judged, `A x B`.
    pub const fn policy_action(&self) -> &DMatrix<T> {
        &self.actor_tape.action
    }

    /// `Q_cL - kappa` at those actions `[B]`.
    pub fn violation(&self) -> &[T] {
        &self.actor_tape.violation
    }

    /// The critic's pessimistic values of a task at those actions, for reward and long-term cost.
    pub fn policy_values(&self, task: Task) -> impl Iterator<Item = T> {
        self.actor_tape.values(task)
    }

    /// The critic's pessimistic values of a task at the recorded actions, before its last update.
    pub fn recorded_values(&self, task: Task) -> impl Iterator<Item = T> {
        self.judgement.recorded[task as usize].iter().copied()
    }

    /// Eqs. 3 and 4: targets, losses and the gradient of each task.
    pub(super) fn judge(&mut self, model: &Model, networks: Networks<'_, T>, batch_len: usize, draw: &Draw<'_, T>) {
        let (first, samples) = (self.first, self.batch.samples());
        let draw = |stage: usize, sample: usize, out: &mut [T]| draw(stage, first + sample, out);
        let mut room = self.rooms.judging.lend(samples, || judging::Room::new(model, samples));
        let batch = (&self.batch, batch_len);
        self.judgement.judge((model, networks), batch, &draw, &mut self.in_sample, &mut room);
        self.rooms.judging.give_back(samples, room);
    }

    /// The terms of Eqs. 13, 15 and 16.
    pub(super) fn act(
        &mut self,
        model: &Model,
        (actor, judges): (Weights<'_, T>, Judges<'_, T>),
        batch_len: usize,
        draw: &Draw<'_, T>,
    ) {
        let first = self.first;
        let draw = |stage: usize, sample: usize, out: &mut [T]| draw(stage, first + sample, out);
        let second_twin = self.second_twin;
        let noise = ActorNoise { levels: &self.levels, cloning: &self.cloning, chain: &draw, second_twin };
        let batch = (&self.batch, batch_len);
        self.actor_loss = model.actor.forward(actor, judges, batch, &noise, &mut self.actor_tape);
    }

    /// The gradients of actor and dual, with the factor `guidance` on `Q_r`.
    pub(super) fn improve(
        &mut self,
        model: &Model,
        (actor, judges): (Weights<'_, T>, Judges<'_, T>),
        batch_len: usize,
        guidance: f64,
    ) {
        self.actor_gradient.fill(T::zero());
        self.dual_gradient.fill(T::zero());
        model.actor.backward(
            actor,
            judges,
            (&self.batch, batch_len),
            guidance,
            &mut self.actor_tape,
            (&mut self.actor_gradient, &mut self.dual_gradient),
        );
    }

    /// Eq. 13: the gradient of the actor.
    pub(super) fn imitate(&mut self, model: &Model, actor: Weights<'_, T>, batch_len: usize) {
        self.actor_gradient.fill(T::zero());
        self.actor_loss = ActorLoss {
            cloning: model.actor.imitate(
                actor,
                (&self.batch, batch_len),
                (&self.levels, &self.cloning),
                &mut self.actor_tape,
                &mut self.actor_gradient,
            ),
            ..ActorLoss::default()
        };
    }
}
