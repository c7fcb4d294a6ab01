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

/// Where a chain's estimate `x0` of the clean action is clipped to the bounds (O-26).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EstimateClip {
    /// At every step; clipped entries pass no gradient.
    EachStep,
    /// At the last one alone, which is the action.
    LastStep,
}

/// Divisor of estimates that no bound shall reach: a power of two, so that no bit is lost.
const OUT_OF_REACH: f64 = (1u32 << 20) as f64;

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
    /// Where the estimate is clipped.
    pub clip: EstimateClip,
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
            clip: EstimateClip::EachStep,
        }
    }

    /// A chain of `length` steps (see [`Schedule::chain`]); the one step of a Gaussian.
    ///
    /// A step that shall not clip estimates a 2^20th of the action, so the controllers that
    /// clip every estimate fly it unchanged.
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
            if self.clip == EstimateClip::LastStep {
                step.from_action /= OUT_OF_REACH;
                step.from_noise /= OUT_OF_REACH;
                step.to_x0 *= OUT_OF_REACH;
            }
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

    /// The formula of [`ChainStep`] by the letter, in f32, with and without the clip.
    #[test]
    fn a_chain_clips_where_it_is_asked_to_with_no_bit_lost() {
        let paper = Process::paper(Schedule::cosine(20));
        let free = Process { clip: EstimateClip::LastStep, ..paper };
        let [paper, free] = [paper, free].map(|process| process.chain(Sampler::Ddpm, 20));
        let run = |step: &ChainStep<f64>, action: f32, noise: f32, bound: f32| {
            let [from_action, from_noise, to_x0, to_action] =
                [step.from_action, step.from_noise, step.to_x0, step.to_action].map(|x| x as f32);
            to_x0 * (from_action * action - from_noise * noise).clamp(-bound, bound) + to_action * action
        };
        let mut clipped = 0;
        for (paper, free) in paper.iter().zip(&free) {
            for (action, noise) in [(0.3, -0.2), (-2.5, 1.5), (4.0, -3.0), (-0.9, 0.4)] {
                let bound = if paper.n == 1 { 1.0 } else { f32::INFINITY };
                let expected = run(paper, action, noise, bound);
                assert_eq!(run(free, action, noise, 1.0), expected, "step {}", paper.n);
                clipped += u32::from(run(paper, action, noise, 1.0) != expected);
            }
        }
        assert!(clipped > 40);
    }
}
