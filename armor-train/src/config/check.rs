//! The range of every option.

use armor_core::schedule::MAX_STEPS;

use super::{Config, ConfigError};
use crate::actor::{Family, PolicyGradient};
use crate::critic::Twins;
use crate::critic::bootstrap::Bootstrap;
use crate::extraction::Extraction;
use crate::extraction::condition::Condition;
use crate::model::ActorCopy;
use crate::reweight::{Averaged, WeightMean};

impl Config {
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
            ("lambda_min", self.lambda_min),
            ("lambda_max", self.lambda_max),
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
            ("relabel_share", self.relabel_share),
            ("final_rate", self.final_rate),
            ("advantage_decay", self.advantage_decay),
            ("cost_errors", self.cost_errors),
        ];
        for (key, value) in shares {
            require(key, (0.0..=1.0).contains(&value), "between 0 and 1")?;
        }
        for (key, value) in [("limit", self.limit), ("eta", self.eta), ("beta", self.beta), ("sigma", self.sigma)] {
            require(key, value.is_finite() && value >= 0.0, "a number of at least 0")?;
        }
        let not_negative = [
            ("dual_slack", self.dual_slack),
            ("dual_decay", self.dual_decay),
            ("temperature", self.temperature),
            ("gaussian_std", self.gaussian_std),
            ("gradient_clip", self.gradient_clip),
            ("weight_decay", self.weight_decay),
            ("reward_noise", self.reward_noise),
            ("advantage_temperature", self.advantage_temperature),
            ("advantage_lambda", self.advantage_lambda),
            ("advantage_cap", self.advantage_cap),
            ("state_noise", self.state_noise),
            ("counterfactual_tolerance", self.counterfactual_tolerance),
        ];
        for (key, value) in not_negative {
            require(key, value.is_finite() && value >= 0.0, "a number of at least 0")?;
        }
        for (key, value) in [("reward_expectile", self.reward_expectile), ("cost_expectile", self.cost_expectile)] {
            require(key, value > 0.0 && value < 1.0, "above 0 and below 1")?;
        }
        let (in_sample, weighted) = (self.bootstrap == Bootstrap::InSample, self.extraction == Extraction::Weighted);
        require("critic_steps", in_sample || self.critic_steps == 0, "0 unless bootstrap is in_sample")?;
        require("critic_steps", self.critic_steps == 0 || self.critic_steps < self.steps, "below steps")?;
        let by_kappa = self.condition == Condition::Kappa;
        require("condition", weighted || by_kappa, "kappa unless extraction is weighted")?;
        let (share, noise) = (self.safest_share, self.state_noise);
        require("safest_share", share > 0.0 && share <= 1.0, "above 0 and at most 1")?;
        require("safest_share", weighted || share == 1.0, "1 unless extraction is weighted")?;
        let by_price = self.condition == Condition::Lambda;
        require(
            "safest_share",
            !by_price || share == 1.0,
            "1 where condition is lambda, whose weights are of all data",
        )?;
        require("state_noise", weighted || noise == 0.0, "0 unless extraction is weighted")?;
        require("lambda_max", self.lambda_min <= self.lambda_max, "at least lambda_min")?;
        require("critic_steps", !weighted || self.critic_steps >= 1, "at least 1 where extraction is weighted")?;
        require("actor_average", (0.0..1.0).contains(&self.actor_average), "from 0 to below 1")?;
        require("feasible_mass", (0.0..1.0).contains(&self.feasible_mass), "from 0 to below 1")?;
        require("dual_normalize", !self.dual_normalize || self.limit > 0.0, "false where the limit is 0")?;
        // TOML has signed numbers only.
        require("seed", i64::try_from(self.seed).is_ok(), "below 2^63")?;
        require("steps", i64::try_from(self.steps).is_ok(), "below 2^63")?;
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
        let averages = self.actor_average > 0.0 || self.target_actor == ActorCopy::Live;
        require("actor_average", averages, "above 0 where target_actor is average")?;
        let by_batch = self.weight_mean == WeightMean::Batch;
        require("weight_mean", !by_batch || !weighted, "data where extraction is weighted")?;
        let averages_cf = self.reweight_averaged == Averaged::Counterfactual;
        require("weight_mean", !by_batch || averages_cf, "data where reweight_averaged is weight")?;
        let twins = self.counterfactual_twins;
        require("counterfactual_twins", twins != Twins::Random, "pessimistic, minimum or mean")?;
        require("refresh_share", self.refresh_share > 0.0 && self.refresh_share <= 1.0, "above 0 and at most 1")?;
        let is_gaussian = self.policy == Family::Gaussian;
        require("diffusion_steps", !is_gaussian || self.diffusion_steps == 1, "1 where policy is gaussian")?;
        let last_k = 1..=self.diffusion_steps;
        let is_last_k = self.policy_gradient == PolicyGradient::LastK;
        require(
            "gradient_steps",
            !is_last_k || last_k.contains(&self.gradient_steps),
            "between 1 and diffusion_steps",
        )?;
        let range = self.log_lambda_min.is_finite() && self.log_lambda_min < self.log_lambda_max;
        require("log_lambda_max", range && self.log_lambda_max <= 50.0, "above log_lambda_min and at most 50")?;
        require("head_layers", (1..=2).contains(&self.head_layers), "1 or 2")?;
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
    use crate::config::Preset;

    #[test]
    fn critics_come_first_only_where_they_need_no_actor() {
        let faults = |assignments: &[&str]| {
            let mut config = Preset::Quick.config("ball-run", 5.0);
            assignments.iter().for_each(|assignment| config.set(assignment).unwrap());
            config.check().err().map(|error| error.to_string())
        };
        let sound = ["bootstrap=in_sample", "extraction=weighted", "critic_steps=100"];
        assert_eq!(faults(&sound), None);
        assert_eq!(faults(&sound[..1]), None);
        let unless = "option `critic_steps` must be 0 unless bootstrap is in_sample";
        assert_eq!(faults(&sound[2..]).as_deref(), Some(unless));
        let weighted = "option `critic_steps` must be at least 1 where extraction is weighted";
        assert_eq!(faults(&sound[..2]).as_deref(), Some(weighted));
        let only = "option `condition` must be kappa unless extraction is weighted";
        assert_eq!(faults(&["condition=lambda"]).as_deref(), Some(only));
        let share = "option `safest_share` must be 1 unless extraction is weighted";
        assert_eq!(faults(&["safest_share=0.5"]).as_deref(), Some(share));
        let priced = "option `safest_share` must be 1 where condition is lambda, whose weights are of all data";
        let conditioned = [&sound[..], &["condition=lambda", "safest_share=0.5"]].concat();
        assert_eq!(faults(&conditioned).as_deref(), Some(priced));
        let noise = "option `state_noise` must be 0 unless extraction is weighted";
        assert_eq!(faults(&["state_noise=0.5"]).as_deref(), Some(noise));
        let below = "option `critic_steps` must be below steps";
        assert_eq!(faults(&["bootstrap=in_sample", "critic_steps=9000"]).as_deref(), Some(below));
    }

    #[test]
    fn an_option_out_of_range_is_named() {
        for bad in [
            "batch=0",
            "target_steps=21",
            "diffusion_steps=65",
            "time_code=5",
            "weight_max=0.1",
            "eta=nan",
            "head_layers=0",
            "cost_errors=1.5",
            "weight_decay=-1",
            "safest_share=0",
            "safest_share=1.1",
            "state_noise=-0.1",
            "counterfactual_twins=random",
        ] {
            let mut config = Preset::Paper.config("ball-run", 5.0);
            config.set(bad).unwrap();
            let error = config.check().unwrap_err().to_string();
            let key = bad.split('=').next().unwrap();
            assert!(error.contains(key) || ["diffusion_steps", "policy"].contains(&key), "{error}");
        }
    }
}
