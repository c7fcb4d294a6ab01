//! Every choice of a training run, with the paper's values and their sources.

use armor_core::schedule::{MAX_STEPS, Sampler};
use serde::{Deserialize, Serialize};

use crate::actor::PolicyGradient;

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

    /// Factor on recorded rewards (O-4).
    pub reward_scale: f64,
    /// Factor on recorded costs and on kappa (O-4).
    pub cost_scale: f64,
    /// Factor on kappa where it enters a network (O-8).
    pub kappa_scale: f64,
    /// Whether the networks see states with mean 0 and variance 1 (O-5).
    pub normalize_states: bool,

    /// Denoising steps `N` (Table 2).
    pub diffusion_steps: usize,
    /// Units of the denoiser's three hidden layers (Appendix B).
    pub hidden: usize,
    /// Hidden units of the kappa embedding (O-8).
    pub kappa_hidden: usize,
    /// Entries of the kappa embedding (O-8).
    pub kappa_embedding: usize,
    /// Entries of the sinusoidal code of a step (O-9).
    pub time_code: usize,
    /// Hidden units of the time embedding (O-9).
    pub time_hidden: usize,
    /// Entries of the time embedding (O-9).
    pub time_embedding: usize,
    /// Units of the critic's two shared layers (Appendix B).
    pub trunk: usize,
    /// Hidden units of a critic head (Appendix B, O-6).
    pub head: usize,
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
    /// Discount of the reward, `gamma_r` (Table 2).
    pub reward_discount: f64,
    /// Discount of the long-term cost, `gamma_cL` (Table 2).
    pub long_cost_discount: f64,
    /// Discount of the short-term cost, `gamma_cS` (Table 2).
    pub short_cost_discount: f64,
    /// Reward guidance coefficient, eta (Eq. 14, Table 2).
    pub eta: f64,
    /// How the policy improvement differentiates (O-13).
    pub policy_gradient: PolicyGradient,
    /// Sampler of the next action in the targets (Eq. 3).
    pub target_sampler: Sampler,
    /// Steps of that sampler, at most `diffusion_steps`.
    pub target_steps: usize,

    /// Training steps before the weights are active (Table 2).
    pub reweight_warmup: u64,
    /// Training steps between refreshes of the weights (Table 2).
    pub reweight_interval: u64,
    /// Share of the new value in the moving average of counterfactual weights (Table 2, O-21).
    pub reweight_ema: f64,
    /// Trajectory weight control coefficient, beta (Eq. 6, Table 2).
    pub beta: f64,
    /// Counterfactual samples `K` (Table 2).
    pub perturbations: usize,
    /// Counterfactual noise, sigma (Table 2).
    pub sigma: f64,
    /// Smallest weight, `w_min` (Eq. 10, Table 2).
    pub weight_min: f64,
    /// Largest weight, `w_max` (Eqs. 9 and 10, Table 2).
    pub weight_max: f64,
}

/// A named set of choices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// The paper to the letter; 200,000 steps of a full-size network.
    Paper,
    /// The same method in minutes: smaller networks, one-step actor gradient, short target chains.
    Quick,
}

impl Preset {
    /// The preset as it is written in a configuration.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Quick => "quick",
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
            reward_scale: 0.1,
            cost_scale: 1.0,
            kappa_scale: 1.0,
            normalize_states: false,
            diffusion_steps: 20,
            hidden: 256,
            kappa_hidden: 32,
            kappa_embedding: 16,
            time_code: 16,
            time_hidden: 32,
            time_embedding: 16,
            trunk: 256,
            head: 128,
            dual_hidden: 256,
            actor_rate: 1e-4,
            critic_rate: 1e-3,
            dual_rate: 1e-4,
            target_rate: 0.005,
            reward_discount: 0.99,
            long_cost_discount: 0.99,
            short_cost_discount: 0.3,
            eta: 1.0,
            policy_gradient: PolicyGradient::Full,
            target_sampler: Sampler::Ddpm,
            target_steps: 20,
            reweight_warmup: 20_000,
            reweight_interval: 5_000,
            reweight_ema: 0.3,
            beta: 0.5,
            perturbations: 8,
            sigma: 0.1,
            weight_min: 0.8,
            weight_max: 2.0,
        };
        match self {
            Self::Paper => paper,
            Self::Quick => Config {
                preset: Self::Quick,
                steps: 8_000,
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
                reweight_warmup: 2_000,
                reweight_interval: 1_000,
                ..paper
            },
        }
    }
}

/// Why a configuration cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
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

impl Config {
    /// Replaces one option by `key=value`; text needs no quotes.
    ///
    /// # Errors
    /// [`ConfigError`] that names the nearest key where there is none of that name.
    pub fn set(&mut self, assignment: &str) -> Result<(), ConfigError> {
        let (key, value) =
            assignment.split_once('=').ok_or_else(|| ConfigError::NotAnAssignment(assignment.to_owned()))?;
        let (key, value) = (key.trim(), value.trim());
        let bad = |reason: String| ConfigError::BadValue { key: key.to_owned(), value: value.to_owned(), reason };
        let mut table = self.options();
        if !table.contains_key(key) {
            let similarity = |name: &&String| (strsim::jaro_winkler(name, key) * 1e6) as u64;
            let nearest = table.keys().max_by_key(similarity).cloned().unwrap_or_default();
            return Err(ConfigError::UnknownKey { key: key.to_owned(), nearest });
        }
        let parsed = match toml::from_str::<toml::Table>(&format!("value = {value}")) {
            Ok(mut parsed) => parsed.remove("value").unwrap_or_else(|| value.into()),
            Err(_) => value.into(),
        };
        // A whole number is welcome where a fraction is expected.
        let parsed = match (&table[key], parsed) {
            (toml::Value::Float(_), toml::Value::Integer(whole)) => toml::Value::Float(whole as f64),
            (_, parsed) => parsed,
        };
        table.insert(key.to_owned(), parsed);
        *self = table.try_into().map_err(|error: toml::de::Error| bad(error.message().to_owned()))?;
        Ok(())
    }

    /// All options by name, as `config.toml` holds them.
    pub fn options(&self) -> toml::Table {
        // Numbers, names and flags: nothing in it that TOML could not say.
        toml::Table::try_from(self).unwrap_or_default()
    }

    /// Whether every option lies in its range.
    ///
    /// # Errors
    /// [`ConfigError::OutOfRange`] for the first that does not.
    pub fn check(&self) -> Result<(), ConfigError> {
        let widths = [
            ("hidden", self.hidden),
            ("kappa_hidden", self.kappa_hidden),
            ("kappa_embedding", self.kappa_embedding),
            ("time_hidden", self.time_hidden),
            ("time_embedding", self.time_embedding),
            ("trunk", self.trunk),
            ("head", self.head),
            ("dual_hidden", self.dual_hidden),
        ];
        for (key, width) in widths {
            require(key, (1..=1024).contains(&width), "between 1 and 1024")?;
        }
        let positive = [
            ("reward_scale", self.reward_scale),
            ("cost_scale", self.cost_scale),
            ("kappa_scale", self.kappa_scale),
            ("actor_rate", self.actor_rate),
            ("critic_rate", self.critic_rate),
            ("dual_rate", self.dual_rate),
        ];
        for (key, value) in positive {
            require(key, value.is_finite() && value > 0.0, "a positive number")?;
        }
        let shares = [
            ("target_rate", self.target_rate),
            ("reward_discount", self.reward_discount),
            ("long_cost_discount", self.long_cost_discount),
            ("short_cost_discount", self.short_cost_discount),
            ("reweight_ema", self.reweight_ema),
        ];
        for (key, value) in shares {
            require(key, (0.0..=1.0).contains(&value), "between 0 and 1")?;
        }
        for (key, value) in [("limit", self.limit), ("eta", self.eta), ("beta", self.beta), ("sigma", self.sigma)] {
            require(key, value.is_finite() && value >= 0.0, "a number of at least 0")?;
        }
        require("limit", self.limit < 65536.0, "below 65536")?;
        require("steps", self.steps >= 1, "at least 1")?;
        require("batch", (1..=65536).contains(&self.batch), "between 1 and 65536")?;
        require("perturbations", (1..=1024).contains(&self.perturbations), "between 1 and 1024")?;
        require("diffusion_steps", (1..=MAX_STEPS).contains(&self.diffusion_steps), "between 1 and 64")?;
        require(
            "target_steps",
            (1..=self.diffusion_steps).contains(&self.target_steps),
            "between 1 and diffusion_steps",
        )?;
        let is_code = self.time_code >= 4 && self.time_code.is_multiple_of(2) && self.time_code <= 1024;
        require("time_code", is_code, "even and between 4 and 1024")?;
        require("reweight_interval", self.reweight_interval >= 1, "at least 1")?;
        let ordered = 0.0 <= self.weight_min && self.weight_min <= self.weight_max && self.weight_max.is_finite();
        require("weight_max", ordered, "a number of at least weight_min, and weight_min at least 0")
    }
}

fn require(key: &'static str, holds: bool, range: &'static str) -> Result<(), ConfigError> {
    if holds { Ok(()) } else { Err(ConfigError::OutOfRange { key, range }) }
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
        for preset in [Preset::Paper, Preset::Quick] {
            preset.config("ball-run", 5.0).check().unwrap();
        }
    }

    #[test]
    fn options_are_set_by_name() {
        let mut config = Preset::Paper.config("ball-run", 5.0);
        config.set("eta=2").unwrap();
        config.set("policy_gradient = one_step").unwrap();
        config.set("normalize_states=true").unwrap();
        assert_eq!((config.eta, config.policy_gradient, config.normalize_states), (2.0, PolicyGradient::OneStep, true));
    }

    #[test]
    fn an_unknown_option_names_the_nearest() {
        let error = Preset::Paper.config("ball-run", 5.0).set("actor_lr=1").unwrap_err();
        assert_eq!(error.to_string(), "there is no option `actor_lr`; did you mean `actor_rate`?");
    }

    #[test]
    fn a_bad_assignment_is_refused_and_changes_nothing() {
        let mut config = Preset::Paper.config("ball-run", 5.0);
        let before = config.clone();
        for bad in ["eta", "eta=high", "batch=-3", "policy_gradient=half"] {
            assert!(config.set(bad).is_err(), "{bad}");
        }
        assert_eq!(config, before);
    }

    #[test]
    fn an_option_out_of_range_is_named() {
        for bad in ["batch=0", "target_steps=21", "diffusion_steps=65", "time_code=5", "weight_max=0.1", "eta=nan"] {
            let mut config = Preset::Paper.config("ball-run", 5.0);
            config.set(bad).unwrap();
            let error = config.check().unwrap_err().to_string();
            let key = bad.split('=').next().unwrap();
            assert!(error.contains(key) || bad.starts_with("diffusion"), "{error}");
        }
    }
}
