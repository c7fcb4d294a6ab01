//! Every choice of a training run, with the paper's values and their sources.

mod assign;
mod check;
mod given;
pub mod options;
mod preset;
mod resolve;

use std::path::PathBuf;

use armor_core::schedule::{Noising, Sampler};
use serde::{Deserialize, Serialize};

use crate::actor::{CloningNorm, EstimateClip, Family, Guidance, PolicyGradient, ReverseVariance};
use crate::critic::bootstrap::Bootstrap;
use crate::critic::{CostHeads, CostOutput, Trunk, TwinLoss, Twins};
use crate::data::{Mask, Unfinished};
use crate::dual::DualClip;
use crate::extraction::condition::{Condition, LambdaRange};
use crate::extraction::trace::Trace;
use crate::extraction::{Advantage, Extraction};
use crate::model::{ActorCopy, CriticCopy};
use crate::nn::TimeFrequencies;
use crate::pcgrad::{Order, Pooling};
use crate::reweight::reference::Reference;
use crate::reweight::{Averaged, MarginMean, Scales, WeightMean};
use crate::sampling::Sampling;
use crate::selection::Choice;
use crate::threshold::Threshold;

pub use given::Given;
pub use preset::Preset;
pub use resolve::{KappaUnit, RewardUnit};

/// The effective configuration of a run; it is saved as `config.toml` in the run's folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Preset that the other keys started from.
    pub preset: Preset,
    /// Path of the recorded data.
    pub data: String,
    /// Task, such as `ball-run`.
    pub task: String,
    /// Cost limit `d` of an episode, in units of recorded cost (Eq. 1).
    pub limit: f64,
    /// Seed of everything random.
    pub seed: u64,
    /// Training steps (Table 2).
    pub steps: u64,
    /// Transitions of a training step (Table 2).
    pub batch: usize,
    /// What a batch is drawn from (O-31).
    pub sampling: Sampling,
    /// Which actor of the run flies (O-24).
    pub selection: Choice,

    /// What becomes of the rows after the last end mark (O-1).
    pub unfinished: Unfinished,
    /// Which last steps of an episode are not followed by any value (O-3).
    pub done_mask: Mask,
    /// What decides `reward_scale` (O-4).
    pub reward_unit: RewardUnit,
    /// Factor on recorded rewards (O-4).
    pub reward_scale: f64,
    /// Factor on recorded costs and on kappa (O-4).
    pub cost_scale: f64,
    /// What decides `kappa_scale` (O-8).
    pub kappa_unit: KappaUnit,
    /// Factor on kappa where it enters a network (O-8).
    pub kappa_scale: f64,
    /// Whether the networks see states with mean 0 and variance 1 (O-5).
    pub normalize_states: bool,
    /// Noise on recorded rewards, in their standard deviations; 0, none, in the paper.
    pub reward_noise: f64,
    /// Share of recorded costs that are misread; 0, none, in the paper.
    pub cost_errors: f64,

    /// What the policy's distribution is; a diffusion in the paper (section 4.5).
    pub policy: Family,
    /// Denoising steps `N` (Table 2).
    pub diffusion_steps: usize,
    /// How fast an action is noised (O-25).
    pub noise_schedule: Noising,
    /// Variance of a DDPM step (O-27).
    pub reverse_variance: ReverseVariance,
    /// Where a chain's estimate of the clean action is clipped (O-26).
    pub x0_clip: EstimateClip,
    /// Factor on the noise that DDPM steps add (O-27).
    pub temperature: f64,
    /// Standard deviation of a Gaussian policy, in units of the action's bounds.
    pub gaussian_std: f64,
    /// Units of the denoiser's three hidden layers (Appendix B).
    pub hidden: usize,
    /// Hidden units of the kappa embedding (O-8).
    pub kappa_hidden: usize,
    /// Entries of the kappa embedding (O-8).
    pub kappa_embedding: usize,
    /// What the frequencies of a step's code are (O-9).
    pub time_frequencies: TimeFrequencies,
    /// Entries of the sinusoidal code of a step (O-9).
    pub time_code: usize,
    /// Hidden units of the time embedding (O-9).
    pub time_hidden: usize,
    /// Entries of the time embedding (O-9).
    pub time_embedding: usize,
    /// Units of the critic's two shared layers (Appendix B).
    pub trunk: usize,
    /// Hidden units of a critic head (Appendix B).
    pub head: usize,
    /// Hidden layers of a critic head, 1 or 2 (O-6).
    pub head_layers: usize,
    /// What the critic's estimates share; a trunk in the paper (section 4.5).
    pub critic_trunk: Trunk,
    /// Pairs of heads that estimate costs; one for each horizon in the paper (section 4.5).
    pub cost_heads: CostHeads,
    /// What follows the last layer of a cost head (O-7).
    pub cost_output: CostOutput,
    /// Units of the dual network's two hidden layers (Appendix B).
    pub dual_hidden: usize,

    /// Learning rate of the actor (Table 2).
    pub actor_rate: f64,
    /// Learning rate of the critic (Table 2).
    pub critic_rate: f64,
    /// Learning rate of the dual (Appendix B).
    pub dual_rate: f64,
    /// Soft update of the target critic, tau (Appendix B).
    pub target_rate: f64,
    /// How the losses of a critic's twins are joined (O-11).
    pub twin_loss: TwinLoss,
    /// Order of gradient surgery on the shared trunk (Eq. 5, O-17), or none (section 4.5).
    pub pcgrad: Order,
    /// How the tasks' trunk gradients become one (Eq. 5, O-17).
    pub trunk_gradient: Pooling,
    /// Discount of the reward, `gamma_r` (Table 2).
    pub reward_discount: f64,
    /// Discount of the long-term cost, `gamma_cL` (Table 2).
    pub long_cost_discount: f64,
    /// Discount of the short-term cost, `gamma_cS` (Table 2).
    pub short_cost_discount: f64,
    /// Reward guidance coefficient, eta (Eq. 14, Table 2).
    pub eta: f64,
    /// What eta counts in (O-14).
    pub guidance: Guidance,
    /// How the error of behaviour cloning is summed over action entries (Eq. 13, O-12).
    pub cloning_norm: CloningNorm,
    /// How the policy improvement differentiates (O-13).
    pub policy_gradient: PolicyGradient,
    /// Last steps of the chain that `policy_gradient = last_k` differentiates (O-13).
    pub gradient_steps: usize,
    /// Sampler of the next action in the targets (Eq. 3).
    pub target_sampler: Sampler,
    /// Steps of that sampler, at most `diffusion_steps`.
    pub target_steps: usize,

    /// What the critics' targets bootstrap from (Eq. 3).
    pub bootstrap: Bootstrap,
    /// Whether the critics see kappa; they do in the paper. Recorded data meet
    /// every budget by construction, so a critic that sees kappa finds nearly all of it feasible.
    pub critic_sees_kappa: bool,
    /// Expectile of the state values of reward.
    pub reward_expectile: f64,
    /// Expectile of the state values of cost; below 0.5 leans towards the cheapest action.
    pub cost_expectile: f64,
    /// Training steps of the critics alone, which are frozen then while the
    /// actor learns for the rest; 0, both at once, in the paper.
    pub critic_steps: u64,
    /// How the actor takes up what the critics know (Eqs. 13 to 15).
    pub extraction: Extraction,
    /// By what advantage weights judge an action.
    pub advantage: Advantage,
    /// Decay of the trace where that is what was recorded.
    pub advantage_decay: f64,
    /// Inverse temperature alpha of advantage weights.
    pub advantage_temperature: f64,
    /// Price lambda of cost in advantage weights, in units of scaled advantages.
    pub advantage_lambda: f64,
    /// Largest logarithm of an advantage weight.
    pub advantage_cap: f64,
    /// Share of the trajectories within the limit that weighted extraction clones: those
    /// whose states have the least mean `V_cL`; 1 clones all that was recorded.
    pub safest_share: f64,
    /// Noise on the states that weighted extraction clones from, in units of what the
    /// networks see. An actor is cloned from few drivers, and meets states near theirs.
    pub state_noise: f64,
    /// What the actor is conditioned on; kappa in the paper.
    pub condition: Condition,
    /// Smallest price of cost that an actor conditioned on it is trained for.
    pub lambda_min: f64,
    /// Largest such price.
    pub lambda_max: f64,

    /// Share of samples whose kappa is relabelled with a larger budget; 0 in the
    /// paper. Recorded kappa always ends at 0, so a clone learns to spend it all.
    pub relabel_share: f64,
    /// What `Q_cL` is held against in Eqs. 14 to 16.
    pub threshold: Threshold,
    /// Added to that, in units of recorded cost; 0 in the paper. Noise in `Q_cL`
    /// otherwise keeps the constraint violated at kappa 0.
    pub dual_slack: f64,
    /// Whether the violation is counted in limits instead of units of cost.
    pub dual_normalize: bool,
    /// Smallest log lambda (Appendix B).
    pub log_lambda_min: f64,
    /// Largest log lambda (Appendix B).
    pub log_lambda_max: f64,
    /// What the clip to that range passes back (O-16).
    pub dual_clip: DualClip,
    /// Factor on the squared norm of the dual's weights in its loss; 0 in the paper (O-16).
    pub dual_decay: f64,
    /// Whether the dual's last layer starts at 0, and so lambda at 1 (O-16).
    pub dual_zero_start: bool,
    /// Learning rates at the last step as a share of the first, along half a
    /// cosine; 1, constant, in the paper (O-30).
    pub final_rate: f64,
    /// Largest Euclidean norm of a network's gradient; 0, no limit, in the paper (O-30).
    pub gradient_clip: f64,
    /// Decoupled weight decay of actor and critics; 0, none, in the paper (O-30).
    pub weight_decay: f64,
    /// Decay of a moving average of the actor's weights, which is exported in
    /// their place; 0, none, in the paper (O-10).
    pub actor_average: f64,
    /// The actor that takes the next action of the targets (Eq. 3, O-10).
    pub target_actor: ActorCopy,
    /// The critic that judges the policy's actions (Eq. 15, O-15).
    pub policy_critic: CriticCopy,
    /// Which of its twins (Eq. 15, O-15).
    pub policy_twins: Twins,

    /// Which scales of reweighting are on (section 4.5).
    pub reweight: Scales,
    /// Training steps before the weights are active (Table 2).
    pub reweight_warmup: u64,
    /// Training steps between refreshes of the weights (Table 2).
    pub reweight_interval: u64,
    /// Share of the transitions that a refresh looks at (O-18).
    pub refresh_share: f64,
    /// What the moving average over refreshes is of (O-21).
    pub reweight_averaged: Averaged,
    /// Share of the new value in that moving average (Table 2, O-21).
    pub reweight_ema: f64,
    /// Trajectory weight control coefficient, beta (Eq. 6, Table 2).
    pub beta: f64,
    /// Share of the weight that feasible trajectories get together; 0 leaves it
    /// to `beta`, as the paper does.
    pub feasible_mass: f64,
    /// Counterfactual samples `K` (Table 2).
    pub perturbations: usize,
    /// Counterfactual noise, sigma (Table 2).
    pub sigma: f64,
    /// Whether sigma counts in standard deviations of each recorded action entry.
    pub sigma_per_entry: bool,
    /// What `Q_cS` is held against in Eq. 8.
    pub counterfactual_reference: Reference,
    /// Added to that, in units of recorded cost; 0 in the paper.
    pub counterfactual_tolerance: f64,
    /// The critic of Eq. 8 (O-19).
    pub counterfactual_critic: CriticCopy,
    /// Which of its twins (O-19).
    pub counterfactual_twins: Twins,
    /// Over what the margins of Eq. 9 have their mean (O-22).
    pub margin_mean: MarginMean,
    /// Over what the weights of Eq. 10 have their mean (O-22).
    pub weight_mean: WeightMean,
    /// Smallest weight, `w_min` (Eq. 10, Table 2).
    pub weight_min: f64,
    /// Largest weight, `w_max` (Eqs. 9 and 10, Table 2).
    pub weight_max: f64,
}

impl Config {
    /// The factor on what the actor is conditioned on, where that enters its embedding, in units of scaled
    /// cost for kappa; a leniency lies within 0 and 1 already.
    pub const fn condition_scale(&self) -> f64 {
        match self.condition {
            Condition::Kappa => self.kappa_scale,
            Condition::Lambda | Condition::None => 1.0,
        }
    }

    /// The traces of reward and long-term cost, where advantages follow the recording.
    pub fn traces(&self) -> Option<[Trace; 2]> {
        let trace = |discount| Trace { discount, decay: self.advantage_decay };
        (self.advantage == Advantage::Recorded).then(|| [self.reward_discount, self.long_cost_discount].map(trace))
    }

    /// The prices of cost that an actor conditioned on them is trained for.
    pub const fn lambda_range(&self) -> LambdaRange {
        LambdaRange { min: self.lambda_min, max: self.lambda_max }
    }
}

/// Why a configuration cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// A file that cannot be parsed.
    #[error("{}: line {line} is no TOML: {reason}", file.display())]
    NotToml {
        /// The file.
        file: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// What was expected.
        reason: String,
    },
    /// A key without which no run can start.
    #[error("--{key} is missing; give it, or `{key}` in the file of --config")]
    Missing {
        /// The option.
        key: &'static str,
    },
    /// A task that the paper does not have, without a cost limit.
    #[error("--limit is missing: {task} is no task of the paper, whose limit would be known")]
    NoLimit {
        /// The task.
        task: String,
    },
    /// A `--set` without `=`.
    #[error("`{0}` is not of the form key=value")]
    NotAnAssignment(String),
    /// A key that does not exist.
    #[error("there is no option `{key}`; did you mean `{nearest}`?")]
    UnknownKey {
        /// What was given.
        key: String,
        /// The most similar existing key.
        nearest: String,
    },
    /// A value of the wrong kind.
    #[error("option `{key}` cannot be `{value}`: {reason}")]
    BadValue {
        /// The option.
        key: String,
        /// What was given.
        value: String,
        /// What was expected.
        reason: String,
    },
    /// A value out of its range.
    #[error("option `{key}` must be {range}")]
    OutOfRange {
        /// The option.
        key: &'static str,
        /// Its range in words.
        range: &'static str,
    },
}
