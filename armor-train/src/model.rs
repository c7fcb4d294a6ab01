//! The networks of a run: their layouts, their numbers, their optimisers.

use armor_core::noise::{Noise, uniform};
use armor_core::schedule::{ChainStep, Schedule};
use serde::{Deserialize, Serialize};

use crate::actor::denoiser::{Denoiser, Widths};
use crate::actor::{Actor, Family, Process};
use crate::config::Config;
use crate::critic::bootstrap::Bootstrap;
use crate::critic::value::StateValue;
use crate::critic::{Critic, CriticOptions, Trunk};
use crate::dual::{Dual, DualOptions};
use crate::nn::{Adam, Scalar, TimeFrequencies};
use crate::pcgrad::{Order, Pooling};
use crate::phase::Phase;
use crate::stream;

/// Layouts and fixed settings of the networks.
#[derive(Clone, Debug)]
pub struct Model {
    /// The diffusion actor.
    pub actor: Actor,
    /// The multi-task critic.
    pub critic: Critic,
    /// The state values that targets bootstrap from; none where they ask the policy.
    pub state_value: Option<StateValue>,
    /// The dual variable.
    pub dual: Dual,
    /// Factor on the squared norm of the dual's weights in its loss.
    pub dual_decay: f64,
    /// Whether a moving average of the actor's weights is kept.
    pub keeps_average: bool,
    /// The actor that takes the next action of the targets.
    pub target_actor: ActorCopy,
    /// The critic that judges the policy's actions.
    pub policy_critic: CriticCopy,
    /// Chain that samples the next action of the targets.
    pub target_chain: Vec<ChainStep<f64>>,
    /// Discounts of reward, long-term and short-term cost.
    pub discounts: [f64; 3],
    /// Largest norm of a network's gradient; 0 is no limit.
    pub gradient_clip: f64,
    /// Gradient surgery on the critic's trunk.
    pub pcgrad: Order,
    /// How the tasks' trunk gradients become one.
    pub trunk_gradient: Pooling,
}

/// The numbers of all networks, each a flat vector.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Parameters<T: Scalar> {
    /// Denoiser, phi.
    pub actor: Vec<T>,
    /// Moving average of the denoiser's weights; empty where none is kept.
    pub actor_average: Vec<T>,
    /// Critic, theta.
    pub critic: Vec<T>,
    /// Target critic, theta minus.
    pub target: Vec<T>,
    /// State values; empty where there are none.
    pub state_value: Vec<T>,
    /// Dual network.
    pub dual: Vec<T>,
}

/// A copy of the critic (O-15, O-19).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CriticCopy {
    /// The one that learns (the paper).
    Live,
    /// The target critic, which follows it slowly.
    Target,
}

/// A copy of the actor (O-10).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ActorCopy {
    /// The one that learns (the paper).
    Live,
    /// The moving average of its weights.
    Average,
}

impl<T: Scalar> Parameters<T> {
    /// The numbers of a copy of the critic.
    pub fn critic_copy(&self, copy: CriticCopy) -> &[T] {
        match copy {
            CriticCopy::Live => &self.critic,
            CriticCopy::Target => &self.target,
        }
    }

    /// The numbers of a copy of the actor; of the live one where no average is kept.
    pub fn actor_copy(&self, copy: ActorCopy) -> &[T] {
        match copy {
            ActorCopy::Average if !self.actor_average.is_empty() => &self.actor_average,
            ActorCopy::Live | ActorCopy::Average => &self.actor,
        }
    }
}

/// The optimisers of the networks that learn by gradients.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Optimisers<T: Scalar> {
    /// Of the actor.
    pub actor: Adam<T>,
    /// Of the critic.
    pub critic: Adam<T>,
    /// Of the state values.
    pub state_value: Adam<T>,
    /// Of the dual network.
    pub dual: Adam<T>,
}

impl Model {
    /// The networks of a configuration for data with the given dimensions.
    pub fn new(config: &Config, state: usize, action: usize) -> Self {
        let widths = Widths {
            state,
            action,
            hidden: config.hidden,
            kappa_hidden: config.kappa_hidden,
            kappa_embedding: config.kappa_embedding,
            time_code: config.time_code,
            time_hidden: config.time_hidden,
            time_embedding: config.time_embedding,
            steps: config.diffusion_steps,
        };
        let process = Process {
            schedule: Schedule { noising: config.noise_schedule, steps: config.diffusion_steps },
            family: config.policy,
            gaussian_std: config.gaussian_std,
            variance: config.reverse_variance,
            temperature: config.temperature,
            clip: config.x0_clip,
        };
        let denoiser = Denoiser::new(widths, config.condition_scale());
        let denoiser = match config.time_frequencies {
            TimeFrequencies::Geometric => denoiser,
            TimeFrequencies::Learned => denoiser.with_learned_frequencies(),
        };
        // A critic that shall not tell budgets apart sees 0.
        let critic_scale = if config.critic_sees_kappa { config.kappa_scale } else { 0.0 };
        let expectiles = [config.reward_expectile, config.cost_expectile, config.cost_expectile];
        Self {
            actor: Actor {
                denoiser: match config.policy {
                    Family::Diffusion => denoiser,
                    Family::Gaussian => denoiser.blind(),
                },
                process,
                policy_gradient: config.policy_gradient,
                gradient_steps: config.gradient_steps,
                cloning_norm: config.cloning_norm,
                eta: config.eta,
                guidance: config.guidance,
                constraint_scale: if config.dual_normalize { 1.0 / (config.limit * config.cost_scale) } else { 1.0 },
                twins: config.policy_twins,
            },
            critic: Critic::with_options(
                CriticOptions {
                    trunk: config.critic_trunk,
                    cost_heads: config.cost_heads,
                    head_layers: config.head_layers,
                    cost_output: config.cost_output,
                    twin_loss: config.twin_loss,
                },
                [state, action, config.trunk, config.head],
                critic_scale,
            ),
            state_value: (config.bootstrap == Bootstrap::InSample)
                .then(|| StateValue::new(state, config.trunk, critic_scale, expectiles)),
            dual: Dual::new(
                DualOptions {
                    log_range: [config.log_lambda_min, config.log_lambda_max],
                    clip: config.dual_clip,
                    starts_at_one: config.dual_zero_start,
                },
                config.dual_hidden,
                config.kappa_scale,
            ),
            dual_decay: config.dual_decay,
            keeps_average: config.actor_average > 0.0,
            target_actor: config.target_actor,
            policy_critic: config.policy_critic,
            target_chain: process.chain(config.target_sampler, config.target_steps),
            gradient_clip: config.gradient_clip,
            pcgrad: config.pcgrad,
            // Trunks of their own take their own gradients, which meet nowhere.
            trunk_gradient: match config.critic_trunk {
                Trunk::Shared => config.trunk_gradient,
                Trunk::Separate => Pooling::Sum,
            },
            discounts: [config.reward_discount, config.long_cost_discount, config.short_cost_discount],
        }
    }

    /// Fresh numbers from a seed; the target critic starts as a copy of the critic.
    pub fn initialise<T: Scalar>(&self, noise: Noise) -> Parameters<T> {
        let draws = |network: u64| {
            (0..)
                .flat_map(move |block| noise.words(stream::INITIALISE, network, block))
                .map(|word| f64::from(uniform(word)))
        };
        let mut actor = vec![T::zero(); self.actor.denoiser.size()];
        let mut critic = vec![T::zero(); self.critic.size()];
        let mut dual = vec![T::zero(); self.dual.size()];
        self.actor.denoiser.initialise(&mut actor, &mut draws(0));
        self.critic.initialise(&mut critic, &mut draws(1));
        self.dual.initialise(&mut dual, &mut draws(2));
        let mut state_value = Vec::new();
        if let Some(value) = &self.state_value {
            state_value.resize(value.size(), T::zero());
            value.initialise(&mut state_value, &mut draws(3));
        }
        let actor_average = if self.keeps_average { actor.clone() } else { Vec::new() };
        Parameters { actor, actor_average, target: critic.clone(), critic, state_value, dual }
    }
}

impl<T: Scalar> Optimisers<T> {
    /// Fresh moments at the configured learning rates.
    pub fn new(config: &Config, parameters: &Parameters<T>) -> Self {
        Self {
            actor: Adam::new(parameters.actor.len(), config.actor_rate),
            critic: Adam::new(parameters.critic.len(), config.critic_rate),
            state_value: Adam::new(parameters.state_value.len(), config.critic_rate),
            dual: Adam::new(parameters.dual.len(), config.dual_rate),
        }
    }

    /// Sets the learning rates of a training step: along half a cosine from the
    /// configured ones to their `final_rate` share at the end of its phase (O-30).
    pub fn schedule(&mut self, config: &Config, step: u64) {
        let cosine = 0.5 + 0.5 * (std::f64::consts::PI * Phase::progress(config, step)).cos();
        let factor = config.final_rate + (1.0 - config.final_rate) * cosine;
        self.actor.set_rate(config.actor_rate * factor);
        self.critic.set_rate(config.critic_rate * factor);
        self.state_value.set_rate(config.critic_rate * factor);
        self.dual.set_rate(config.dual_rate * factor);
    }

    /// Shrinks the weights of actor and critics by `decay` times their learning rates (AdamW,
    /// Loshchilov and Hutter 2019).
    pub fn shrink(&self, parameters: &mut Parameters<T>, decay: f64, [critics, actor]: [bool; 2]) {
        let Parameters { actor: of_actor, critic, state_value, .. } = parameters;
        let networks = [
            (critics, &self.critic, critic),
            (critics, &self.state_value, state_value),
            (actor, &self.actor, of_actor),
        ];
        for (_, optimiser, weights) in networks.into_iter().filter(|(trains, ..)| *trains) {
            let factor = T::of(1.0 - decay * optimiser.rate());
            weights.iter_mut().for_each(|weight| *weight *= factor);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Preset;

    #[test]
    fn weights_shrink_by_decay_times_rate_where_they_are_trained() {
        let mut config = Preset::Paper.config("own", 1.0);
        (config.actor_rate, config.critic_rate) = (0.1, 0.2);
        let weights = |parameters: &Parameters<f64>| {
            [&parameters.critic, &parameters.state_value, &parameters.actor, &parameters.dual].map(|w| w[0])
        };
        for (trained, expected) in [
            ([true, true], [0.9, 0.9, 0.95, 1.0]),
            ([true, false], [0.9, 0.9, 1.0, 1.0]),
            ([false, true], [1.0, 1.0, 0.95, 1.0]),
        ] {
            let one = || vec![1.0];
            let mut parameters = Parameters {
                actor: one(),
                actor_average: one(),
                critic: one(),
                target: one(),
                state_value: one(),
                dual: one(),
            };
            let optimisers = Optimisers::new(&config, &parameters);
            optimisers.shrink(&mut parameters, 0.5, trained);
            for (found, expected) in weights(&parameters).into_iter().zip(expected) {
                assert!((found - expected).abs() < 1e-12);
            }
        }
    }

    /// Adam's first step is as long as its learning rate.
    #[test]
    fn learning_rates_fall_along_half_a_cosine() {
        let mut config = Preset::Paper.config("own", 1.0);
        (config.steps, config.actor_rate, config.final_rate) = (10, 1.0, 0.2);
        let first_step = |step| {
            let mut parameters = Parameters {
                actor: vec![0.0f64],
                actor_average: vec![],
                critic: vec![],
                target: vec![],
                state_value: vec![],
                dual: vec![],
            };
            let mut optimisers = Optimisers::new(&config, &parameters);
            optimisers.schedule(&config, step);
            optimisers.actor.descend(&mut parameters.actor, &[1.0]);
            -parameters.actor[0]
        };
        for (step, expected) in [(0, 1.0), (5, 0.6), (10, 0.2)] {
            assert!((first_step(step) - expected).abs() < 1e-6);
        }
    }
}
