//! The policy's own action, and how the critics' gradient flows back from it (Eq. 15).

use armor_core::schedule::Sampler;
use serde::{Deserialize, Serialize};

use super::chain::{Chain, clip, coefficients};
use super::{Actor, ActorNoise, ActorTape};
use crate::nn::{Scalar, Weights};

/// Where the action `a_pi` of the policy improvement comes from, and how its gradient flows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PolicyGradient {
    /// A sample of the full chain, with the gradient through all its steps (the paper).
    Full,
    /// The same sample, with the gradient through its last steps alone.
    LastK,
    /// The estimate `x0` from the noised data action of `L_BC`: no further call of the network.
    OneStep,
}

impl Actor {
    /// Room for the policy's chain on `samples` columns.
    pub(super) fn chain<T: Scalar>(&self, samples: usize) -> Chain<T> {
        let steps: Vec<_> = match self.policy_gradient {
            PolicyGradient::Full | PolicyGradient::LastK => {
                self.process.chain(Sampler::Ddpm, self.process.schedule.steps)
            }
            PolicyGradient::OneStep => Vec::new(),
        };
        let gradient_steps = match self.policy_gradient {
            PolicyGradient::LastK => self.gradient_steps,
            PolicyGradient::Full | PolicyGradient::OneStep => steps.len(),
        };
        Chain::new(&self.denoiser, steps, samples, gradient_steps)
    }

    /// `a_pi`, by the full chain or by the one-step estimate.
    pub(super) fn sample<T: Scalar>(
        &self,
        weights: Weights<'_, T>,
        noise: &ActorNoise<'_, T>,
        tape: &mut ActorTape<T>,
    ) {
        match self.policy_gradient {
            PolicyGradient::Full | PolicyGradient::LastK => {
                let lent = || tape.chains.lend(tape.action.ncols(), || self.chain(tape.action.ncols()));
                let chain = tape.chain.get_or_insert_with(lent);
                chain.run(&self.denoiser, weights, &tape.context, noise.chain);
                tape.action.copy_from(&chain.action);
            }
            PolicyGradient::OneStep => {
                for (sample, &level) in noise.levels.iter().enumerate() {
                    let [from_action, from_noise, ..] = self.estimate::<T>(level);
                    for row in 0..tape.action.nrows() {
                        let at = (row, sample);
                        let estimate = from_action * tape.call.action[at] - from_noise * tape.call.noise()[at];
                        (tape.action[at], tape.inside[at]) = clip(estimate);
                    }
                }
            }
        }
    }

    /// Carries the critics' gradient at `a_pi` back to the network.
    pub(super) fn improve<T: Scalar>(&self, weights: Weights<'_, T>, tape: &mut ActorTape<T>, gradient: &mut [T]) {
        let ActorTape { context, call, chain, chains, inside, action_gradient, .. } = tape;
        match self.policy_gradient {
            PolicyGradient::Full | PolicyGradient::LastK => {
                if let Some(mut chain) = chain.take() {
                    chain.backward(&self.denoiser, weights, context, action_gradient, gradient);
                    chains.give_back(chain.action.ncols(), chain);
                }
            }
            PolicyGradient::OneStep => {
                for sample in 0..inside.ncols() {
                    let [_, from_noise, ..] = self.estimate::<T>(call.levels[sample]);
                    let through = action_gradient.column(sample).component_mul(&inside.column(sample));
                    let mut noise_gradient = call.noise_gradient().column_mut(sample);
                    noise_gradient -= through * from_noise;
                }
            }
        }
    }

    /// The coefficients of the estimate of `x0` at a noise level.
    fn estimate<T: Scalar>(&self, level: usize) -> [T; 5] {
        coefficients(&self.process.estimate(level))
    }
}
