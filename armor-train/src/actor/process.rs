//! The reverse process: the chains that a policy flies and is trained with.
//!
//! A Gaussian policy is one step of the same chain (section 4.5, "w/o diffusion"):
//!
//! ```text
//! x0 = clip(std a^N + mean(s, kappa), -1, 1),      a^N ~ N(0, I)
//! ```
//!
//! with the network's answer in place of the predicted noise and no eye on the
//! noisy action, so that the image and its controller need nothing new.

use armor_core::schedule::{ChainStep, Sampler, Schedule};
use serde::{Deserialize, Serialize};

/// What the policy's distribution is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Family {
    /// A denoising chain (the paper).
    Diffusion,
    /// A Gaussian of fixed standard deviation around the network's answer, clipped to the bounds.
    Gaussian,
}

/// The variance of a DDPM step (O-27).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ReverseVariance {
    /// That of the posterior `q(a^m | a^n, x0)`.
    Posterior,
    /// `beta`, that of the forward step; larger.
    Beta,
}

/// A policy's family and the settings of its chains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Process {
    /// The forward process.
    pub schedule: Schedule,
    /// What the policy's distribution is.
    pub family: Family,
    /// Standard deviation of [`Family::Gaussian`], in units of the action's bounds.
    pub gaussian_std: f64,
    /// The variance of a DDPM step.
    pub variance: ReverseVariance,
    /// Factor on the noise that DDPM steps add.
    pub temperature: f64,
}

impl Process {
    /// The paper's process over a schedule.
    pub const fn paper(schedule: Schedule) -> Self {
        Self {
            schedule,
            family: Family::Diffusion,
            gaussian_std: 0.0,
            variance: ReverseVariance::Posterior,
            temperature: 1.0,
        }
    }

    /// A chain of `length` steps (see [`Schedule::chain`]); the one step of a Gaussian.
    pub fn chain(&self, sampler: Sampler, length: usize) -> Vec<ChainStep<f64>> {
        if self.family == Family::Gaussian {
            return vec![self.estimate(1)];
        }
        let mut chain: Vec<_> = self.schedule.chain(sampler, length).collect();
        // The last step adds no noise, whatever the variance.
        for index in 1..chain.len() {
            let next = chain[index].n;
            let step = &mut chain[index - 1];
            if let (Sampler::Ddpm, ReverseVariance::Beta) = (sampler, self.variance) {
                step.sigma = (1.0 - self.schedule.alpha_bar(step.n) / self.schedule.alpha_bar(next)).sqrt();
            }
            step.sigma *= self.temperature;
        }
        chain
    }

    /// The step that estimates the clean action from noise level `n`, `1..=N`.
    pub fn estimate(&self, n: usize) -> ChainStep<f64> {
        match self.family {
            Family::Diffusion => self.schedule.step(Sampler::Ddpm, n, 0),
            Family::Gaussian => ChainStep {
                n,
                from_action: self.gaussian_std,
                from_noise: -1.0,
                to_x0: 1.0,
                to_action: 0.0,
                sigma: 0.0,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_ddpm_noise_is_changed_by_variance_and_temperature_and_the_last_step_adds_none() {
        let schedule = Schedule::vp(20);
        let paper = Process::paper(schedule);
        let other = Process { variance: ReverseVariance::Beta, temperature: 0.5, ..paper };
        assert_eq!(paper.chain(Sampler::Ddpm, 20), schedule.chain(Sampler::Ddpm, 20).collect::<Vec<_>>());
        assert_eq!(other.chain(Sampler::Ddim, 7), paper.chain(Sampler::Ddim, 7));
        for (step, plain) in other.chain(Sampler::Ddpm, 20).into_iter().zip(paper.chain(Sampler::Ddpm, 20)) {
            let expected = if step.n == 1 { 0.0 } else { 0.5 * schedule.beta(step.n).sqrt() };
            assert!((step.sigma - expected).abs() < 1e-12);
            assert_eq!(ChainStep { sigma: plain.sigma, ..step }, plain);
        }
    }
}
