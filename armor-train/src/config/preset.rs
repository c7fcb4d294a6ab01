//! Named sets of choices.

use armor_core::schedule::{Noising, Sampler};
use serde::{Deserialize, Serialize};

use super::{Config, KappaUnit, RewardUnit};
use crate::actor::{CloningNorm, EstimateClip, Family, Guidance, PolicyGradient, ReverseVariance};
use crate::critic::bootstrap::Bootstrap;
use crate::critic::{CostHeads, CostOutput, Trunk, TwinLoss, Twins};
use crate::data::{Mask, Unfinished};
use crate::dual::DualClip;
use crate::extraction::condition::Condition;
use crate::extraction::{Advantage, Extraction};
use crate::model::{ActorCopy, CriticCopy};
use crate::nn::TimeFrequencies;
use crate::pcgrad::{Order, Pooling};
use crate::reweight::reference::Reference;
use crate::reweight::{Averaged, MarginMean, Scales, WeightMean};
use crate::sampling::Sampling;
use crate::selection::Choice;
use crate::threshold::Threshold;

/// A named set of choices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// The paper to the letter; 200,000 steps of a full-size network.
    Paper,
    /// The same method in minutes: smaller networks, one-step actor gradient,
    /// short target chains; in a short run feasible trajectories need a larger weight.
    /// What flies is an average of the actor, and rates fall: without them one
    /// seed in three was unsafe on ball-run.
    Quick,
    /// What measured best on a task (`docs/options.md`): on point-circle a clone of the safest
    /// trajectories, as all guidance is unsafe there; elsewhere `quick`, which no change that was tried beats.
    Tuned,
}

impl Preset {
    /// The preset as it is written in a configuration.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Quick => "quick",
            Self::Tuned => "tuned",
        }
    }

    /// The preset's choices for a task and its cost limit.
    pub fn config(self, task: &str, limit: f64) -> Config {
        let paper = Config {
            preset: Self::Paper,
            data: String::new(),
            task: task.to_owned(),
            limit,
            seed: 0,
            steps: 200_000,
            batch: 512,
            sampling: Sampling::Uniform,
            selection: Choice::Last,
            unfinished: Unfinished::Drop,
            done_mask: Mask::Any,
            reward_unit: RewardUnit::Given,
            reward_scale: 0.1,
            cost_scale: 1.0,
            kappa_unit: KappaUnit::Given,
            kappa_scale: 1.0,
            normalize_states: false,
            reward_noise: 0.0,
            cost_errors: 0.0,
            policy: Family::Diffusion,
            diffusion_steps: 20,
            noise_schedule: Noising::Vp,
            reverse_variance: ReverseVariance::Posterior,
            x0_clip: EstimateClip::EachStep,
            temperature: 1.0,
            gaussian_std: 0.1,
            hidden: 256,
            kappa_hidden: 32,
            kappa_embedding: 16,
            time_frequencies: TimeFrequencies::Geometric,
            time_code: 16,
            time_hidden: 32,
            time_embedding: 16,
            trunk: 256,
            head: 128,
            head_layers: 1,
            critic_trunk: Trunk::Shared,
            cost_heads: CostHeads::PerHorizon,
            cost_output: CostOutput::Linear,
            dual_hidden: 256,
            actor_rate: 1e-4,
            critic_rate: 1e-3,
            dual_rate: 1e-4,
            target_rate: 0.005,
            twin_loss: TwinLoss::Sum,
            pcgrad: Order::Random,
            trunk_gradient: Pooling::Mean,
            reward_discount: 0.99,
            long_cost_discount: 0.99,
            short_cost_discount: 0.3,
            eta: 1.0,
            guidance: Guidance::Raw,
            cloning_norm: CloningNorm::Sum,
            policy_gradient: PolicyGradient::Full,
            gradient_steps: 3,
            target_sampler: Sampler::Ddpm,
            target_steps: 20,
            bootstrap: Bootstrap::Policy,
            critic_sees_kappa: true,
            reward_expectile: 0.7,
            cost_expectile: 0.5,
            critic_steps: 0,
            extraction: Extraction::Guidance,
            advantage: Advantage::Critics,
            advantage_decay: 1.0,
            advantage_temperature: 2.0,
            advantage_lambda: 2.0,
            advantage_cap: 3.0,
            safest_share: 1.0,
            state_noise: 0.0,
            condition: Condition::Kappa,
            lambda_min: 0.5,
            lambda_max: 4.0,
            relabel_share: 0.0,
            threshold: Threshold::Kappa,
            dual_slack: 0.0,
            dual_normalize: false,
            log_lambda_min: -20.0,
            log_lambda_max: 5.0,
            dual_clip: DualClip::ZeroGradient,
            dual_decay: 0.0,
            dual_zero_start: false,
            final_rate: 1.0,
            gradient_clip: 0.0,
            weight_decay: 0.0,
            actor_average: 0.0,
            target_actor: ActorCopy::Live,
            policy_critic: CriticCopy::Live,
            policy_twins: Twins::Pessimistic,
            reweight: Scales::Both,
            reweight_warmup: 20_000,
            reweight_interval: 5_000,
            refresh_share: 1.0,
            reweight_averaged: Averaged::Counterfactual,
            reweight_ema: 0.3,
            beta: 0.5,
            feasible_mass: 0.0,
            perturbations: 8,
            sigma: 0.1,
            sigma_per_entry: false,
            counterfactual_reference: Reference::Kappa,
            counterfactual_tolerance: 0.0,
            counterfactual_critic: CriticCopy::Live,
            counterfactual_twins: Twins::Pessimistic,
            margin_mean: MarginMean::Batch,
            weight_mean: WeightMean::Data,
            weight_min: 0.8,
            weight_max: 2.0,
        };
        let quick = Config {
            preset: Self::Quick,
            steps: 9_000,
            batch: 256,
            normalize_states: true,
            hidden: 128,
            trunk: 128,
            head: 64,
            dual_hidden: 64,
            actor_rate: 5e-4,
            target_rate: 0.01,
            policy_gradient: PolicyGradient::OneStep,
            target_sampler: Sampler::Ddim,
            target_steps: 5,
            final_rate: 0.05,
            actor_average: 0.998,
            reweight_warmup: 1_000,
            reweight_interval: 1_000,
            beta: 10.0,
            weight_min: 0.1,
            weight_max: 5.0,
            ..paper.clone()
        };
        match self {
            Self::Paper => paper,
            Self::Quick => quick,
            Self::Tuned if POINT_CIRCLE.contains(&task) => Config { preset: Self::Tuned, ..safest(quick) },
            Self::Tuned => Config { preset: Self::Tuned, ..quick },
        }
    }
}

/// The tasks on which `tuned` clones the safest trajectories.
pub(super) const POINT_CIRCLE: [&str; 2] = ["point-circle", "SafetyPointCircle1-v0"];

/// Cloning of the trajectories that keep to safe states, from noisy states. The slow target critic is a
/// part of it: one that has converged knows how each driver went on, and tells drivers without cost no more apart.
fn safest(quick: Config) -> Config {
    Config {
        steps: 25_000,
        critic_steps: 10_000,
        bootstrap: Bootstrap::InSample,
        critic_sees_kappa: false,
        extraction: Extraction::Weighted,
        advantage_temperature: 0.0,
        safest_share: 0.3,
        state_noise: 0.3,
        condition: Condition::None,
        done_mask: Mask::Terminal,
        reweight: Scales::Off,
        ..quick
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Table 2 and Appendix B of the paper.
    #[test]
    fn the_paper_preset_is_the_papers_tables() {
        let c = Preset::Paper.config("ball-run", 5.0);
        assert_eq!((c.steps, c.batch, c.diffusion_steps), (200_000, 512, 20));
        assert_eq!((c.actor_rate, c.critic_rate, c.dual_rate), (1e-4, 1e-3, 1e-4));
        assert_eq!((c.reward_discount, c.long_cost_discount, c.short_cost_discount), (0.99, 0.99, 0.3));
        assert_eq!((c.eta, c.target_rate, c.beta, c.sigma, c.perturbations), (1.0, 0.005, 0.5, 0.1, 8));
        assert_eq!((c.reweight_warmup, c.reweight_interval, c.reweight_ema), (20_000, 5_000, 0.3));
        assert_eq!((c.weight_min, c.weight_max), (0.8, 2.0));
        assert_eq!((c.hidden, c.trunk, c.head, c.dual_hidden), (256, 256, 128, 256));
        assert_eq!(c.policy_gradient, PolicyGradient::Full);
    }

    #[test]
    fn presets_pass_their_own_check() {
        for preset in [Preset::Paper, Preset::Quick, Preset::Tuned] {
            for task in ["ball-run", POINT_CIRCLE[0]] {
                preset.config(task, 5.0).check().unwrap();
            }
        }
    }
}
