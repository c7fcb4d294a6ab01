//! Noise schedules and the steps of a denoising chain.
//!
//! The paper leaves the schedule open. [`Noising::Vp`] is that of score-based
//! diffusion discretised to `N` steps: its cumulative product has the closed form
//! `abar_n = exp(-(beta_min t + (beta_max - beta_min) t^2 / 2))`, `t = n / N`,
//! and falls to 0.0064 at `n = N`, so a chain may start from `N(0, I)`.
//! [`Noising::Cosine`] (Nichol and Dhariwal 2021) keeps more of the action in the
//! middle of a chain and falls to 1e-5.
//!
//! Words: `n` runs from `N` (pure noise) to 0 (the action); `abar` is the
//! paper's alpha-bar (Eq. 11).

use core::f64::consts::FRAC_PI_2;

use serde::{Deserialize, Serialize};

/// The largest number of steps a chain may have.
pub const MAX_STEPS: usize = 64;

/// Noise rate of [`Noising::Vp`] at `t = 0`.
const BETA_MIN: f64 = 0.1;
/// Noise rate of [`Noising::Vp`] at `t = 1`.
const BETA_MAX: f64 = 10.0;
/// Keeps the first noise of [`Noising::Cosine`] from being too small.
const COSINE_OFFSET: f64 = 0.008;
/// The largest `beta_n` of [`Noising::Cosine`], met at `n = N`, where the cosine is 0.
const COSINE_BETA_MAX: f64 = 0.999;

/// How fast an action is noised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Noising {
    /// Variance-preserving, `beta(t)` linear from 0.1 to 10 (the `paper` preset).
    Vp,
    /// `abar_n = cos^2(pi/2 (t + s) / (1 + s)) / cos^2(pi/2 s / (1 + s))`, `s = 0.008`.
    Cosine,
}

/// A noise schedule over `steps` steps (Eq. 11).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Schedule {
    /// How fast an action is noised.
    pub noising: Noising,
    /// `N`, 1 to [`MAX_STEPS`].
    pub steps: usize,
}

/// How a chain goes from one noise level to a lower one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sampler {
    /// Draws from the posterior `q(a^m | a^n, x0)` (Ho et al. 2020; Eq. 12).
    Ddpm,
    /// Moves along the deterministic trajectory (Song et al. 2021, eta 0).
    Ddim,
}

/// One step of a chain, from noise level `n` to a lower level `m`:
///
/// ```text
/// x0  = clip(from_action a^n - from_noise eps(a^n, n), bounds)
/// a^m = to_x0 x0 + to_action a^n + sigma z,    z ~ N(0, I)
/// ```
///
/// The schedule computes it in f64; an image stores it, and a controller flies it, in f32.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChainStep<T = f32> {
    /// The noise level `n` that the step starts from, `1..=N`.
    pub n: usize,
    /// `1 / sqrt(abar_n)`.
    pub from_action: T,
    /// `sqrt(1 - abar_n) / sqrt(abar_n)`.
    pub from_noise: T,
    /// Weight of the clipped estimate.
    pub to_x0: T,
    /// Weight of the action before the step.
    pub to_action: T,
    /// Standard deviation of the added noise; 0 on the last step and for DDIM.
    pub sigma: T,
}

impl Schedule {
    /// The schedule of the `paper` preset over `steps` steps.
    pub const fn vp(steps: usize) -> Self {
        Self { noising: Noising::Vp, steps }
    }

    /// The cosine schedule over `steps` steps.
    pub const fn cosine(steps: usize) -> Self {
        Self { noising: Noising::Cosine, steps }
    }

    /// `abar_n`, the share of the action's variance left at level `n`; `abar_0 = 1`.
    pub fn alpha_bar(&self, n: usize) -> f64 {
        let time = |n: usize| n as f64 / self.steps as f64;
        match self.noising {
            Noising::Vp => {
                let t = time(n);
                libm::exp(-(BETA_MIN * t + 0.5 * (BETA_MAX - BETA_MIN) * t * t))
            }
            Noising::Cosine => {
                let cosine = |t: f64| libm::cos(FRAC_PI_2 * (t + COSINE_OFFSET) / (1.0 + COSINE_OFFSET));
                let curve = |n: usize| libm::pow(cosine(time(n)) / cosine(0.0), 2.0);
                curve(n).max((1.0 - COSINE_BETA_MAX) * curve(n.saturating_sub(1)))
            }
        }
    }

    /// `beta_n = 1 - abar_n / abar_{n-1}`, the variance added at step `n >= 1`.
    pub fn beta(&self, n: usize) -> f64 {
        1.0 - self.alpha_bar(n) / self.alpha_bar(n.saturating_sub(1))
    }

    /// The step from level `n` to level `m < n`.
    pub fn step(&self, sampler: Sampler, n: usize, m: usize) -> ChainStep<f64> {
        let (here, there) = (self.alpha_bar(n), self.alpha_bar(m));
        let (noise_here, noise_there) = (1.0 - here, 1.0 - there);
        let (to_x0, to_action, variance) = match sampler {
            Sampler::Ddpm => {
                let alpha = here / there;
                let beta = 1.0 - alpha;
                (
                    beta * libm::sqrt(there) / noise_here,
                    noise_there * libm::sqrt(alpha) / noise_here,
                    beta * noise_there / noise_here,
                )
            }
            Sampler::Ddim => {
                let ratio = libm::sqrt(noise_there / noise_here);
                (libm::sqrt(there) - libm::sqrt(here) * ratio, ratio, 0.0)
            }
        };
        ChainStep {
            n,
            from_action: 1.0 / libm::sqrt(here),
            from_noise: libm::sqrt(noise_here / here),
            to_x0,
            to_action,
            sigma: libm::sqrt(variance),
        }
    }

    /// A chain of `length` steps at evenly spaced levels, from `N` down to 0.
    ///
    /// `length` is taken as at least 1 and at most `N`; with `N` it is the full chain.
    pub fn chain(&self, sampler: Sampler, length: usize) -> impl ExactSizeIterator<Item = ChainStep<f64>> + use<> {
        let schedule = *self;
        let length = length.clamp(1, self.steps);
        let level = move |i: usize| (i * schedule.steps).div_ceil(length);
        (0..length).rev().map(move |i| schedule.step(sampler, level(i + 1), level(i)))
    }
}

impl ChainStep<f64> {
    /// The step as a controller flies it.
    pub const fn to_f32(self) -> ChainStep {
        ChainStep {
            n: self.n,
            from_action: self.from_action as f32,
            from_noise: self.from_noise as f32,
            to_x0: self.to_x0 as f32,
            to_action: self.to_action as f32,
            sigma: self.sigma as f32,
        }
    }
}

impl ChainStep {
    /// Words of a step in an image.
    pub const WORDS: usize = 6;

    /// The step as it stands in an image: `n`, then the coefficients as f32 bits.
    pub const fn to_words(self) -> [u32; Self::WORDS] {
        [
            self.n as u32,
            self.from_action.to_bits(),
            self.from_noise.to_bits(),
            self.to_x0.to_bits(),
            self.to_action.to_bits(),
            self.sigma.to_bits(),
        ]
    }

    /// The inverse of [`ChainStep::to_words`].
    pub const fn from_words(words: [u32; Self::WORDS]) -> Self {
        Self {
            n: words[0] as usize,
            from_action: f32::from_bits(words[1]),
            from_noise: f32::from_bits(words[2]),
            to_x0: f32::from_bits(words[3]),
            to_action: f32::from_bits(words[4]),
            sigma: f32::from_bits(words[5]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    const N20: Schedule = Schedule::vp(20);

    #[track_caller]
    fn close(actual: f64, expected: f64, tolerance: f64) {
        assert!((actual - expected).abs() <= tolerance, "{actual} is not {expected}");
    }

    /// The constants of the algorithm's specification, to the digits it states.
    #[test]
    fn constants_at_twenty_steps() {
        close(N20.beta(1), 0.0172, 5e-5);
        close(N20.beta(20), 0.3859, 5e-5);
        close(N20.alpha_bar(1), 0.9828, 5e-5);
        close(N20.alpha_bar(10), 0.2760, 5e-5);
        close(N20.alpha_bar(20), 0.00641, 5e-6);
    }

    /// `alphas_cumprod` of the publication's recipe in NumPy, with its clip of beta to 0.999:
    /// `t = np.arange(21) / 20; f = np.cos((t + .008) / 1.008 * np.pi / 2) ** 2`
    /// `np.cumprod(1 - np.minimum(1 - f[1:] / f[:-1], .999))[[0, 9, 18, 19]]`
    #[test]
    fn the_cosine_schedule_is_the_publications() {
        for (n, expected) in [
            (1, 0.992_007_278_684_218_6),
            (10, 0.49384359044063775),
            (19, 0.006059644621451166),
            (20, 6.059_644_621_451_172e-6),
        ] {
            close(Schedule::cosine(20).alpha_bar(n), expected, 1e-12);
        }
        assert_eq!(Schedule::cosine(20).alpha_bar(0), 1.0);
        close(Schedule::cosine(1).beta(1), 0.999, 1e-12);
    }

    #[test]
    fn alpha_bar_is_the_product_of_one_minus_beta() {
        for schedule in [N20, Schedule::cosine(20)] {
            let mut product = 1.0;
            for n in 1..=20 {
                product *= 1.0 - schedule.beta(n);
                close(schedule.alpha_bar(n), product, 1e-15);
            }
        }
    }

    #[test]
    fn ddpm_steps_have_the_posterior_coefficients() {
        for n in 1..=20 {
            let (beta, here, there) = (N20.beta(n), N20.alpha_bar(n), N20.alpha_bar(n - 1));
            let step = N20.step(Sampler::Ddpm, n, n - 1);
            close(step.to_x0, beta * there.sqrt() / (1.0 - here), 1e-12);
            close(step.to_action, (1.0 - there) * (1.0 - beta).sqrt() / (1.0 - here), 1e-12);
            close(step.sigma, (beta * (1.0 - there) / (1.0 - here)).sqrt(), 1e-12);
        }
    }

    #[test]
    fn the_last_step_returns_the_estimate_without_noise() {
        for sampler in [Sampler::Ddpm, Sampler::Ddim] {
            let last = N20.chain(sampler, 20).last().unwrap();
            assert_eq!((last.n, last.to_x0, last.to_action, last.sigma), (1, 1.0, 0.0, 0.0));
        }
    }

    /// Whatever the levels, a step must turn `q(a^n)` into `q(a^m)`: mean
    /// `sqrt(abar_m) x0` and variance `1 - abar_m`, when `x0` is exact.
    #[test]
    fn every_step_keeps_the_marginals() {
        let samplers = [Sampler::Ddpm, Sampler::Ddim];
        for (schedule, sampler) in [N20, Schedule::cosine(20)].into_iter().flat_map(|s| samplers.map(|kind| (s, kind)))
        {
            for length in 1..=20 {
                let mut levels = schedule.chain(sampler, length).map(|s| s.n).skip(1).collect::<Vec<_>>();
                levels.push(0);
                for (step, m) in schedule.chain(sampler, length).zip(levels) {
                    let (here, there) = (schedule.alpha_bar(step.n), schedule.alpha_bar(m));
                    let (to_x0, to_action) = (step.to_x0, step.to_action);
                    close(to_x0 + to_action * here.sqrt(), there.sqrt(), 1e-12);
                    close(to_action.powi(2) * (1.0 - here) + step.sigma.powi(2), 1.0 - there, 1e-12);
                }
            }
        }
    }

    #[test]
    fn chains_are_evenly_spaced_from_n_to_one_step_above_zero() {
        let levels = |length| N20.chain(Sampler::Ddim, length).map(|s| s.n).collect::<Vec<_>>();
        assert_eq!(levels(20), (1..=20).rev().collect::<Vec<_>>());
        assert_eq!(levels(5), [20, 16, 12, 8, 4]);
        assert_eq!(levels(1), [20]);
        assert_eq!(levels(0), levels(1));
        assert_eq!(levels(99), levels(20));
    }

    #[test]
    fn words_bring_a_step_back() {
        let step = N20.step(Sampler::Ddpm, 7, 6).to_f32();
        assert_eq!(ChainStep::from_words(step.to_words()), step);
    }
}
