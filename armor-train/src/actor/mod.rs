//! The conditional diffusion actor (section 3.4, Eqs. 11 to 15).
//!
//! ```text
//! L_BC  = mean_b w_b |eps_hat(a^n, s, kappa, n) - eps|^2            a^n = sqrt(abar_n) a + sqrt(1 - abar_n) eps
//! L_phi = L_BC - eta mean_b Q_r(s, kappa, a_pi) + mean_b lambda(kappa) (Q_cL(s, kappa, a_pi) - kappa)
//! ```

pub mod chain;
pub mod denoiser;
mod guidance;
mod improvement;
mod loss;
mod process;
mod tape;

use std::sync::Arc;

use nalgebra::DMatrix;

use crate::batch::Batch;
use crate::critic::{Critic, Pick, Task, Twins};
use crate::dual::Dual;
use crate::nn::{Scalar, Weights};
use crate::pool::Pool;
use chain::{Chain, Draw};
use denoiser::Denoiser;

pub use guidance::{CloningNorm, Guidance};
pub use improvement::PolicyGradient;
pub use loss::ActorLoss;
pub use process::{EstimateClip, Family, Process, ReverseVariance};
pub use tape::ActorTape;

/// The actor: its network, its schedule, and how it is improved.
#[derive(Clone, Debug)]
pub struct Actor {
    /// The noise predictor.
    pub denoiser: Denoiser,
    /// The chains of the policy.
    pub process: Process,
    /// How the policy improvement differentiates.
    pub policy_gradient: PolicyGradient,
    /// Steps of [`PolicyGradient::LastK`].
    pub gradient_steps: usize,
    /// How the error of behaviour cloning is summed.
    pub cloning_norm: CloningNorm,
    /// Reward guidance coefficient, eta of Eq. 14.
    pub eta: f64,
    /// What eta counts in.
    pub guidance: Guidance,
    /// Factor on the violation of the constraint; 1 in the paper.
    pub constraint_scale: f64,
    /// Which of the critic's twins judge the actor.
    pub twins: Twins,
}

/// The noise of one update: levels `[B]`, cloning noise `A x B`, and the chain's draws.
pub struct ActorNoise<'a, T: Scalar> {
    /// Noise level of each sample, `1..=N`.
    pub levels: &'a [usize],
    /// `eps` of Eq. 13.
    pub cloning: &'a DMatrix<T>,
    /// Draws of the chain behind `a_pi`.
    pub chain: &'a Draw<'a, T>,
    /// Whether the second of the critic's twins is drawn, where that is random.
    pub second_twin: bool,
}

/// The networks that judge the actor, frozen during its update.
#[derive(Clone, Copy)]
pub struct Judges<'a, T: Scalar> {
    /// The live critic and its parameters.
    pub critic: (&'a Critic, Weights<'a, T>),
    /// The dual network and its parameters.
    pub dual: (&'a Dual, &'a [T]),
}

impl Actor {
    /// Room for updates on `samples` columns, with the room of their chains from `chains`.
    pub fn tape<T: Scalar>(
        &self,
        critic: &Critic,
        dual: &Dual,
        samples: usize,
        chains: Arc<Pool<Chain<T>>>,
    ) -> ActorTape<T> {
        let action = || DMatrix::zeros(self.denoiser.widths().action, samples);
        ActorTape {
            context: self.denoiser.context(samples),
            call: self.denoiser.call(samples),
            chain: None,
            chains,
            inside: action(),
            critic: critic.tape(samples),
            pick: Pick::PESSIMISTIC,
            dual: dual.tape(samples),
            action: action(),
            violation: vec![T::zero(); samples],
            action_gradient: action(),
        }
    }

    /// The terms of `L_phi` (Eq. 15) and `L_lambda` (Eq. 16), summed over `batch`, a
    /// share of `batch_len` samples; [`Actor::backward`] may follow.
    pub fn forward<'a, T: Scalar>(
        &self,
        weights: impl Into<Weights<'a, T>>,
        judges: Judges<'_, T>,
        (batch, batch_len): (&Batch<T>, usize),
        noise: &ActorNoise<'_, T>,
        tape: &mut ActorTape<T>,
    ) -> ActorLoss {
        let weights = weights.into();
        let share = T::of(1.0 / batch_len as f64);
        self.denoiser.prepare(weights, &batch.state, &batch.kappa, &mut tape.context);
        let cloning = self.clone_behaviour(weights, batch, share, (noise.levels, noise.cloning), tape);
        self.sample(weights, noise, tape);

        let (critic, critic_weights) = judges.critic;
        let tasks = [Task::Reward, Task::LongCost];
        let at_policy = (&batch.state, &batch.kappa[..], &tape.action);
        critic.forward(critic_weights, &tasks, at_policy, &mut tape.critic, true);
        tape.pick = Pick { twins: self.twins, second: noise.second_twin };
        let scale = T::of(self.constraint_scale);
        let pairs = tape.critic.values(Task::LongCost, tape.pick).zip(&batch.threshold);
        for (violation, (q, &threshold)) in tape.violation.iter_mut().zip(pairs) {
            *violation = scale * (q - threshold);
        }
        let (dual, dual_parameters) = judges.dual;
        dual.forward(dual_parameters, &batch.kappa, &mut tape.dual);

        let values = |task| tape.values(task).map(T::to_f64);
        let lambda = || tape.dual.lambda.iter().map(|lambda| lambda.to_f64());
        ActorLoss {
            cloning,
            reward: values(Task::Reward).sum(),
            reward_size: values(Task::Reward).map(f64::abs).sum(),
            long_cost: values(Task::LongCost).sum(),
            penalty: lambda().zip(&tape.violation).map(|(lambda, violation)| lambda * violation.to_f64()).sum(),
            lambda: lambda().sum(),
        }
    }

    /// The gradients of `L_phi` and `L_lambda` after [`Actor::forward`], added to `gradient`
    /// and `dual_gradient`, with the factor `guidance` on `Q_r`; means are over `batch_len` samples.
    pub fn backward<'a, T: Scalar>(
        &self,
        weights: impl Into<Weights<'a, T>>,
        judges: Judges<'_, T>,
        (batch, batch_len): (&Batch<T>, usize),
        guidance: f64,
        tape: &mut ActorTape<T>,
        (gradient, dual_gradient): (&mut [T], &mut [T]),
    ) {
        let weights = weights.into();
        let share = T::of(1.0 / batch_len as f64);
        let ((critic, critic_weights), (dual, dual_parameters)) = (judges.critic, judges.dual);
        dual.backward(dual_parameters, &tape.violation, batch_len, &mut tape.dual, dual_gradient);

        let scale = T::of(self.constraint_scale);
        let reward_slope = vec![-T::of(guidance) * share; batch.samples()];
        let cost_slope: Vec<T> = tape.dual.lambda.iter().map(|&lambda| lambda * scale * share).collect();
        let slopes = [(Task::Reward, &reward_slope[..]), (Task::LongCost, &cost_slope[..])];
        critic.action_gradient(critic_weights, (&slopes, tape.pick), &mut tape.critic, &mut tape.action_gradient);

        self.improve(weights, tape, gradient);
        self.denoiser.backward(weights, &mut tape.context, &mut tape.call, gradient);
        self.denoiser.add_body_gradient(std::slice::from_ref(&tape.call), gradient);
        self.denoiser.finish(weights, &batch.state, &mut tape.context, gradient);
    }

    /// The gradient of `L_BC` (Eq. 13) alone, added to `gradient`, for noise levels `[B]` and noise
    /// `A x B`; the mean is over `batch_len` samples, of which `batch` is a share. Returns the summed loss.
    ///
    /// The embedding sees what the batch says the actor is conditioned on.
    pub fn imitate<'a, T: Scalar>(
        &self,
        weights: impl Into<Weights<'a, T>>,
        (batch, batch_len): (&Batch<T>, usize),
        noise: (&[usize], &DMatrix<T>),
        tape: &mut ActorTape<T>,
        gradient: &mut [T],
    ) -> f64 {
        let weights = weights.into();
        let share = T::of(1.0 / batch_len as f64);
        self.denoiser.prepare(weights, &batch.state, &batch.condition, &mut tape.context);
        let loss = self.clone_behaviour(weights, batch, share, noise, tape);
        self.denoiser.backward(weights, &mut tape.context, &mut tape.call, gradient);
        self.denoiser.add_body_gradient(std::slice::from_ref(&tape.call), gradient);
        self.denoiser.finish(weights, &batch.state, &mut tape.context, gradient);
        loss
    }

    /// Eqs. 11 and 13: noises the recorded actions, predicts the noise, and sets
    /// the gradient of `L_BC` with respect to the prediction. A Gaussian predicts the
    /// recorded action itself, and sees the noise alone. Returns the summed loss.
    fn clone_behaviour<T: Scalar>(
        &self,
        weights: Weights<'_, T>,
        batch: &Batch<T>,
        share: T,
        (levels, noise): (&[usize], &DMatrix<T>),
        tape: &mut ActorTape<T>,
    ) -> f64 {
        let call = &mut tape.call;
        let norm = T::of(self.cloning_norm.factor(batch.action.nrows()));
        call.levels.copy_from_slice(levels);
        let target = match self.process.family {
            Family::Diffusion => {
                for (sample, &level) in levels.iter().enumerate() {
                    let alpha_bar = self.process.schedule.alpha_bar(level);
                    let (signal, spread) = (T::of(alpha_bar.sqrt()), T::of((1.0 - alpha_bar).sqrt()));
                    let noised = batch.action.column(sample) * signal + noise.column(sample) * spread;
                    call.action.set_column(sample, &noised);
                }
                noise
            }
            Family::Gaussian => {
                call.action.copy_from(noise);
                &batch.action
            }
        };
        self.denoiser.forward(weights, &tape.context, call, true);
        let mut loss = 0.0;
        for (sample, &weight) in batch.weight.iter().enumerate() {
            let error = call.noise().column(sample) - target.column(sample);
            loss += (norm * weight * error.norm_squared()).to_f64();
            call.noise_gradient().set_column(sample, &(error * (T::of(2.0) * norm * weight * share)));
        }
        loss
    }
}

#[cfg(test)]
mod tests;
