//! The critic's part of an update, for a share of the batch (section 3.2).

use crate::actor::chain::{Chain, Draw};
use crate::actor::denoiser::Context;
use crate::batch::Batch;
use crate::critic::bootstrap::InSample;
use crate::critic::{CriticTape, Task, bellman_target};
use crate::model::Model;
use crate::nn::{Scalar, Weights};

/// The networks of the critic's update.
#[derive(Clone, Copy)]
pub(super) struct Networks<'a, T> {
    /// The actor that draws the next actions.
    pub(super) actor: Weights<'a, T>,
    pub(super) target: Weights<'a, T>,
    pub(super) critic: Weights<'a, T>,
    pub(super) state_value: Weights<'a, T>,
}

/// Room for the update on a share.
#[derive(Debug)]
pub(super) struct Room<T: Scalar> {
    next_context: Context<T>,
    next_chain: Chain<T>,
    target: CriticTape<T>,
    critic: CriticTape<T>,
}

impl<T: Scalar> Room<T> {
    /// Room for `samples` samples.
    pub(super) fn new(model: &Model, samples: usize) -> Self {
        let denoiser = &model.actor.denoiser;
        Self {
            next_context: denoiser.context(samples),
            next_chain: Chain::new(denoiser, model.target_chain.clone(), samples, 0),
            target: model.critic.tape(samples),
            critic: model.critic.tape(samples),
        }
    }
}

/// What the critic's update finds on a share.
#[derive(Clone, Debug)]
pub(super) struct Judgement<T: Scalar> {
    targets: Vec<T>,
    /// The values of each task at the recorded actions, the more pessimistic twin's, before the update.
    pub(super) recorded: [Vec<T>; 3],
    /// Gradient of the heads; its trunk part stays zero.
    pub(super) gradient: Vec<T>,
    pub(super) trunk_gradients: [Vec<T>; 3],
    /// Summed over the share.
    pub(super) losses: [f64; 3],
}

impl<T: Scalar> Judgement<T> {
    pub(super) fn new(model: &Model, samples: usize) -> Self {
        Self {
            targets: Vec::with_capacity(samples),
            recorded: [(); 3].map(|()| Vec::with_capacity(samples)),
            gradient: vec![T::zero(); model.critic.size()],
            trunk_gradients: [(); 3].map(|()| vec![T::zero(); model.critic.trunk_size()]),
            losses: [0.0; 3],
        }
    }

    /// Eqs. 3 and 4: targets, losses and the gradient of each task, means over `batch_len` samples.
    pub(super) fn judge(
        &mut self,
        (model, networks): (&Model, Networks<'_, T>),
        (batch, batch_len): (&Batch<T>, usize),
        draw: &Draw<'_, T>,
        in_sample: &mut Option<InSample<T>>,
        room: &mut Room<T>,
    ) {
        let Room { next_context, next_chain, target, critic: tape } = room;
        let critic = &model.critic;
        let recorded = (&batch.state, &batch.kappa[..], &batch.action);
        if let (Some(in_sample), Some(value)) = (&mut *in_sample, &model.state_value) {
            critic.forward(networks.target, &Task::ALL, recorded, target, false);
            in_sample.regress((value, networks.state_value), (batch, batch_len), target);
        } else {
            let denoiser = &model.actor.denoiser;
            denoiser.prepare(networks.actor, &batch.next_state, &batch.next_kappa, next_context);
            next_chain.run(denoiser, networks.actor, next_context, draw);
            let next = (&batch.next_state, &batch.next_kappa[..], &next_chain.action);
            critic.forward(networks.target, &Task::ALL, next, target, false);
        }
        critic.forward(networks.critic, &Task::ALL, recorded, tape, true);

        self.gradient.fill(T::zero());
        for (index, task) in Task::ALL.into_iter().enumerate() {
            let signal = if task == Task::Reward { &batch.reward } else { &batch.cost };
            let discount = model.discounts[index];
            match in_sample {
                Some(value) => {
                    bellman_target(signal, &batch.alive, discount, value.next_values(task), &mut self.targets);
                }
                None => bellman_target(signal, &batch.alive, discount, target.pessimistic(task), &mut self.targets),
            }
            self.recorded[index].clear();
            self.recorded[index].extend(tape.pessimistic(task));
            let trunk_gradient = &mut self.trunk_gradients[index];
            trunk_gradient.fill(T::zero());
            let gradients = (&mut self.gradient[..], &mut trunk_gradient[..]);
            self.losses[index] = critic.backward_td(networks.critic, task, &self.targets, batch_len, tape, gradients);
        }
    }
}
