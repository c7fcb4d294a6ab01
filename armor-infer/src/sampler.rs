//! A run of a chain, from noise to an action (Eq. 12; [`ChainStep`] has the
//! formulas).
//!
//! DDPM and DDIM are the same run: they differ in the coefficients that the
//! image brings, and a step without `sigma` draws no noise.
//!
//! Noise is addressed, not drawn in turn: at control step `tick`, `a^N` is
//! stream 0, and the `z` of the chain's `i`-th step (from 0) is stream `i + 1`.
//! Where `K` chains run side by side, those of chain `k` are `k` [`STREAMS`] on.

use armor_core::noise::Noise;
use armor_core::schedule::{ChainStep, MAX_STEPS};

use crate::denoiser::{Denoiser, NotFinite, front};
use crate::policy::Policy;

/// Streams of noise that a chain may take: more than it has steps.
pub const STREAMS: u32 = 128;
const _: () = assert!(MAX_STEPS < STREAMS as usize);

/// The working memory of `K` runs, beside the denoiser's.
pub(crate) struct Sampler<const ACTION: usize, const K: usize> {
    eps: [[f32; K]; ACTION],
    z: [f32; ACTION],
}

impl<const ACTION: usize, const K: usize> Sampler<ACTION, K> {
    pub(crate) const fn new() -> Self {
        Self { eps: [[0.0; K]; ACTION], z: [0.0; ACTION] }
    }

    /// Runs a rung of the policy on a prepared denoiser, `K` times, into
    /// `action`, `[A]` entries of `K`.
    ///
    /// # Errors
    /// [`NotFinite`] if an estimate of the action was not finite before it was
    /// clipped. After `Ok` every entry lies within the policy's bounds, for the
    /// last step of a chain is the clipped estimate itself.
    pub(crate) fn run<const STATE: usize, const HIDDEN: usize>(
        &mut self,
        (policy, rung): (&Policy<'_>, usize),
        denoiser: &mut Denoiser<STATE, HIDDEN, K>,
        (noise, tick): (&Noise, u64),
        action: &mut [[f32; K]],
    ) -> Result<(), NotFinite> {
        let bounds = || policy.sections.action_low.iter().zip(policy.sections.action_high);
        let eps = front(&mut self.eps, action.len());
        let z = front(&mut self.z, action.len());

        draw((noise, tick, 0), z, action, |a, z| *a = z);
        for (stream, step) in (1..).zip(policy.chain(rung)) {
            denoiser.eps(policy, step.n, action, eps);
            for ((a, eps), (low, high)) in action.iter_mut().zip(&*eps).zip(bounds()) {
                for (a, eps) in a.iter_mut().zip(eps) {
                    *a = denoise(&step, *a, *eps, *low, *high)?;
                }
            }
            if step.sigma != 0.0 {
                draw((noise, tick, stream), z, action, |a, z| *a += step.sigma * z);
            }
        }
        Ok(())
    }
}

/// Draws for each of `K` actions from its own stream, into `z` `[A]`, and puts every draw to its entry.
fn draw<const K: usize>(
    (noise, tick, stream): (&Noise, u64, u32),
    z: &mut [f32],
    action: &mut [[f32; K]],
    put: impl Fn(&mut f32, f32),
) {
    for (column, stream) in (stream..).step_by(STREAMS as usize).enumerate().take(K) {
        noise.fill_normal(stream, tick, z);
        for (entry, z) in action.iter_mut().filter_map(|entries| entries.get_mut(column)).zip(&*z) {
            put(entry, *z);
        }
    }
}

/// One entry of a step, without the added noise.
fn denoise(step: &ChainStep, a: f32, eps: f32, low: f32, high: f32) -> Result<f32, NotFinite> {
    let estimate = step.from_action * a - step.from_noise * eps;
    if !estimate.is_finite() {
        return Err(NotFinite);
    }
    let x0 = if estimate < low { low } else { estimate };
    let x0 = if x0 > high { high } else { x0 };
    Ok(step.to_x0 * x0 + step.to_action * a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{Fixture, SMALL};
    use armor_core::image::SectionKind;
    use armor_core::schedule::{Sampler as Kind, Schedule};
    use std::vec::Vec;

    const SEED: u64 = 3;
    const TICK: u64 = 5;
    /// Wide enough that nothing is clipped.
    const WIDE: f32 = 1e6;

    /// A policy whose network says `eps` whatever it sees.
    fn constant(eps: f32, sampler: Kind, steps: u16, bound: f32) -> Fixture {
        let mut parts = Fixture::random(SMALL, 1);
        let a = usize::from(SMALL.action);
        parts.section(SectionKind::Output).fill(0);
        let first_bias = parts.section(SectionKind::Output).len() - a;
        parts.section(SectionKind::Output)[first_bias..].fill(eps.to_bits());
        parts.set_bounds(-bound, bound);
        parts.set_rungs(&[(sampler, steps)]);
        parts.build()
    }

    fn run(fixture: &Fixture) -> Vec<f32> {
        let image = fixture.image();
        let policy = Policy::load(&image).unwrap();
        let mut action = std::vec![[0.0]; SMALL.action.into()];
        let (mut denoiser, noise) = (Denoiser::<8, 16, 1>::new(&policy), Noise::new(SEED));
        Sampler::<4, 1>::new().run((&policy, 0), &mut denoiser, (&noise, TICK), &mut action).unwrap();
        action.concat()
    }

    fn draw(stream: u32) -> [f64; 2] {
        let mut values = [0.0; 2];
        Noise::new(SEED).fill_normal(stream, TICK, &mut values);
        values.map(f64::from)
    }

    #[track_caller]
    fn close(actual: f32, expected: f64) {
        let error = (f64::from(actual) - expected).abs();
        assert!(error <= 1e-5 * (1.0 + expected.abs()), "{actual} is not {expected}");
    }

    /// With a constant eps, DDIM keeps its first estimate all the way.
    #[test]
    fn ddim_under_a_constant_network_keeps_its_first_estimate() {
        let abar = Schedule::vp(SMALL.steps.into()).alpha_bar(SMALL.steps.into());
        for steps in [1, 3, SMALL.steps] {
            for eps in [0.0, 0.5] {
                let action = run(&constant(eps, Kind::Ddim, steps, WIDE));
                for (action, start) in action.into_iter().zip(draw(0)) {
                    close(action, (start - (1.0 - abar).sqrt() * f64::from(eps)) / abar.sqrt());
                }
            }
        }
    }

    /// With eps zero, Eq. 12 is `a^{n-1} = a^n / sqrt(alpha_n) + sigma_n z`, so
    /// every draw is divided by the `sqrt(abar)` of the level it enters at.
    #[test]
    fn ddpm_under_a_silent_network_sums_its_scaled_draws() {
        let steps = usize::from(SMALL.steps);
        let schedule = Schedule::vp(steps);
        let action = run(&constant(0.0, Kind::Ddpm, SMALL.steps, WIDE));
        for (entry, action) in action.into_iter().enumerate() {
            let mut expected = draw(0)[entry] / schedule.alpha_bar(steps).sqrt();
            for (stream, n) in (1..).zip((2..=steps).rev()) {
                let (here, there) = (schedule.alpha_bar(n), schedule.alpha_bar(n - 1));
                let sigma = (schedule.beta(n) * (1.0 - there) / (1.0 - here)).sqrt();
                expected += sigma * draw(stream)[entry] / there.sqrt();
            }
            close(action, expected);
        }
    }

    #[test]
    fn every_estimate_is_clipped_to_the_bounds() {
        let bound = 0.25;
        for (eps, expected) in [(1e6, -bound), (-1e6, bound)] {
            assert_eq!(run(&constant(eps, Kind::Ddpm, SMALL.steps, bound)), [expected; 2]);
        }
    }

    #[test]
    fn an_infinite_estimate_is_an_error_and_not_a_bound() {
        let step = ChainStep { n: 1, from_action: 1.0, from_noise: 1.0, to_x0: 1.0, to_action: 0.0, sigma: 0.0 };
        for eps in [f32::INFINITY, f32::NEG_INFINITY, f32::NAN] {
            assert_eq!(denoise(&step, 0.0, eps, -1.0, 1.0), Err(NotFinite));
        }
        assert_eq!(denoise(&step, 0.0, 0.5, -1.0, 1.0), Ok(-0.5));
    }
}
