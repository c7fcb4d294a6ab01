//! The updates of one training step, over shares of the batch (sections 3.2 and 3.4).
//!
//! Each [`Worker`] holds a fixed share of the batch, whatever the number of
//! threads, and gradients are added in the order of the workers: results do not
//! depend on the number of threads.

mod judging;
mod worker;

use rayon::prelude::*;

use crate::actor::chain::Draw;
use crate::actor::{ActorLoss, Guidance, Judges};
use crate::model::{Model, Optimisers, Parameters};
use crate::nn::{Passes, Scalar, Weights, accumulate, clip_norm, soft_update};
use crate::pcgrad::{self, Order, Surgery};
use judging::Networks;

pub use worker::{Rooms, Worker};

/// What the critic's update measured, means over the batch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CriticMetrics {
    /// Losses of reward, long-term and short-term cost, summed over the twins (Eq. 4).
    pub losses: [f64; 3],
    /// Expectile losses of the state values; 0 where there are none.
    pub value_losses: [f64; 3],
    /// Conflicts and norms of the tasks' trunk gradients (Eq. 5, Table A1).
    pub surgery: Surgery,
}

/// Updates the critic: Eqs. 3 and 4 in every share, Eq. 5 on the trunk, one step of Adam;
/// and the state values, where targets bootstrap from them.
///
/// `draw` gives the noise of the next actions by stage and place in the batch,
/// `orders` the order of the others for each task. Returns the gradient with the metrics.
pub fn update_critic<T: Scalar>(
    model: &Model,
    parameters: &mut Parameters<T>,
    optimisers: &mut Optimisers<T>,
    workers: &mut [Worker<T>],
    draw: &Draw<'_, T>,
    orders: &[[usize; 2]; 3],
) -> (CriticMetrics, Vec<T>) {
    let batch_len = workers.iter().map(|worker| worker.batch.samples()).sum();
    {
        // Where targets bootstrap from state values, no actor is asked.
        let actor = parameters.actor_copy(model.target_actor);
        let actor_panels = model.state_value.is_none().then(|| model.actor.denoiser.pack(actor, Passes::Forward));
        let value_panels = model.state_value.as_ref().map(|value| value.pack(&parameters.state_value, Passes::Both));
        let target = model.critic.pack(&parameters.target, Passes::Forward);
        let critic = model.critic.pack(&parameters.critic, Passes::Both);
        let networks = Networks {
            actor: actor_panels.as_ref().map_or(actor.into(), Weights::from),
            target: (&target).into(),
            critic: (&critic).into(),
            state_value: value_panels.as_ref().map_or((&parameters.state_value).into(), Weights::from),
        };
        workers.par_iter_mut().for_each(|worker| worker.judge(model, networks, batch_len, draw));
    }

    let mut gradient = vec![T::zero(); model.critic.size()];
    let mut trunk = [(); 3].map(|()| vec![T::zero(); model.critic.trunk_size()]);
    let mut value_gradient = vec![T::zero(); parameters.state_value.len()];
    let mut metrics = CriticMetrics::default();
    for worker in workers {
        accumulate(&mut gradient, &worker.judgement.gradient);
        for (sum, part) in trunk.iter_mut().zip(&worker.judgement.trunk_gradients) {
            accumulate(sum, part);
        }
        for (sum, part) in metrics.losses.iter_mut().zip(worker.judgement.losses) {
            *sum += part / batch_len as f64;
        }
        if let Some(in_sample) = &worker.in_sample {
            accumulate(&mut value_gradient, &in_sample.gradient);
            for (sum, part) in metrics.value_losses.iter_mut().zip(in_sample.losses) {
                *sum += part / batch_len as f64;
            }
        }
    }
    let orders = (model.pcgrad != Order::Off).then_some(orders);
    metrics.surgery = pcgrad::project(&trunk, orders, model.trunk_gradient, &mut gradient[..model.critic.trunk_size()]);
    clip_norm(&mut gradient, model.gradient_clip);
    clip_norm(&mut value_gradient, model.gradient_clip);
    optimisers.critic.descend(&mut parameters.critic, &gradient);
    optimisers.state_value.descend(&mut parameters.state_value, &value_gradient);
    (metrics, gradient)
}

/// Updates the actor by weighted cloning alone (Eq. 13), one step of Adam.
///
/// Returns the loss as a mean over the batch, and the gradient.
pub fn update_imitation<T: Scalar>(
    model: &Model,
    parameters: &mut Parameters<T>,
    optimisers: &mut Optimisers<T>,
    workers: &mut [Worker<T>],
) -> (f64, Vec<T>) {
    let batch_len = workers.iter().map(|worker| worker.batch.samples()).sum();
    let actor = model.actor.denoiser.pack(&parameters.actor, Passes::Both);
    workers.par_iter_mut().for_each(|worker| worker.imitate(model, (&actor).into(), batch_len));

    let mut gradient = vec![T::zero(); parameters.actor.len()];
    let mut loss = 0.0;
    for worker in workers {
        accumulate(&mut gradient, &worker.actor_gradient);
        loss += worker.actor_loss.cloning / batch_len as f64;
    }
    clip_norm(&mut gradient, model.gradient_clip);
    optimisers.actor.descend(&mut parameters.actor, &gradient);
    (loss, gradient)
}

/// Updates actor and dual (Eqs. 15 and 16), one step of Adam each.
///
/// `draw` gives the noise of the policy's chain by stage and place in the
/// batch. Returns the losses as means over the batch, and the gradients of actor and dual.
pub fn update_actor<T: Scalar>(
    model: &Model,
    parameters: &mut Parameters<T>,
    optimisers: &mut Optimisers<T>,
    workers: &mut [Worker<T>],
    draw: &Draw<'_, T>,
) -> (ActorLoss, [Vec<T>; 2]) {
    let batch_len = workers.iter().map(|worker| worker.batch.samples()).sum();
    let actor = model.actor.denoiser.pack(&parameters.actor, Passes::Both);
    let critic = model.critic.pack(parameters.critic_copy(model.policy_critic), Passes::Both);
    let judges = Judges { critic: (&model.critic, (&critic).into()), dual: (&model.dual, &parameters.dual) };
    let networks = ((&actor).into(), judges);
    let constant = model.actor.guidance.constant(model.actor.eta);
    workers.par_iter_mut().for_each(|worker| {
        worker.act(model, networks, batch_len, draw);
        if let Some(guidance) = constant {
            worker.improve(model, networks, batch_len, guidance);
        }
    });
    let loss = workers.iter().fold(ActorLoss::default(), |sum, worker| sum + worker.actor_loss);
    let loss = loss * (1.0 / batch_len as f64);
    if constant.is_none() {
        let guidance = Guidance::normalized(model.actor.eta, loss.reward_size);
        workers.par_iter_mut().for_each(|worker| worker.improve(model, networks, batch_len, guidance));
    }

    let mut gradient = vec![T::zero(); parameters.actor.len()];
    let mut dual_gradient: Vec<T> = parameters.dual.iter().map(|&p| T::of(2.0 * model.dual_decay) * p).collect();
    for worker in workers {
        accumulate(&mut gradient, &worker.actor_gradient);
        accumulate(&mut dual_gradient, &worker.dual_gradient);
    }
    clip_norm(&mut gradient, model.gradient_clip);
    clip_norm(&mut dual_gradient, model.gradient_clip);
    optimisers.actor.descend(&mut parameters.actor, &gradient);
    optimisers.dual.descend(&mut parameters.dual, &dual_gradient);
    (loss, [gradient, dual_gradient])
}

/// Moves the target critic towards the critic (Appendix B).
pub fn update_target<T: Scalar>(parameters: &mut Parameters<T>, rate: f64) {
    soft_update(&mut parameters.target, &parameters.critic, T::of(rate));
}

#[cfg(test)]
mod tests;
