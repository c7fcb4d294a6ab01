//! Gradients of the whole actor by finite differences, in f64.

use std::sync::Arc;

use armor_core::schedule::{Sampler, Schedule};
use nalgebra::DMatrix;

use super::denoiser::{Denoiser, Widths};
use super::*;
use crate::dual::DualOptions;
use crate::testing::{assert_gradient, fill};

const SAMPLES: usize = 4;
const STEPS: usize = 20;
const LEVELS: [usize; SAMPLES] = [1, 7, 13, 20];

const WIDTHS: Widths = Widths {
    state: 3,
    action: 2,
    hidden: 6,
    kappa_hidden: 4,
    kappa_embedding: 3,
    time_code: 4,
    time_hidden: 5,
    time_embedding: 3,
    steps: STEPS,
};

struct Fixture {
    actor: Actor,
    critic: Critic,
    dual: Dual,
    parameters: Vec<f64>,
    critic_parameters: Vec<f64>,
    dual_parameters: Vec<f64>,
    batch: Batch<f64>,
    cloning: DMatrix<f64>,
    levels: [usize; SAMPLES],
}

fn fixture(policy_gradient: PolicyGradient) -> Fixture {
    let denoiser = Denoiser::new(WIDTHS, 0.5);
    let critic = Critic::new(3, 2, 6, 5, 0.5);
    let dual = Dual::new(DualOptions::default(), 5, 0.5);
    let mut batch = Batch::zeros(3, 2, SAMPLES);
    batch.state = DMatrix::from_vec(3, SAMPLES, fill(3 * SAMPLES, 11));
    batch.action = DMatrix::from_vec(2, SAMPLES, fill(2 * SAMPLES, 12));
    batch.kappa = vec![0.0, 1.0, 2.0, 3.0];
    batch.threshold = batch.kappa.clone();
    batch.weight = vec![0.8, 1.0, 1.5, 2.0];
    Fixture {
        parameters: fill(denoiser.size(), 1),
        critic_parameters: fill(critic.size(), 2),
        dual_parameters: fill(dual.size(), 3),
        actor: Actor {
            denoiser,
            process: Process::paper(Schedule::vp(STEPS)),
            policy_gradient,
            gradient_steps: 4,
            cloning_norm: CloningNorm::Sum,
            eta: 0.7,
            guidance: Guidance::Raw,
            constraint_scale: 0.6,
            twins: Twins::Pessimistic,
        },
        critic,
        dual,
        batch,
        cloning: DMatrix::from_vec(2, SAMPLES, fill(2 * SAMPLES, 13)),
        levels: LEVELS,
    }
}

/// A Gaussian policy on the same batch, wide enough that its clip is met.
fn gaussian(policy_gradient: PolicyGradient) -> Fixture {
    let mut f = fixture(policy_gradient);
    f.actor.denoiser = Denoiser::new(Widths { steps: 1, ..WIDTHS }, 0.5).blind();
    f.actor.process = Process { family: Family::Gaussian, gaussian_std: 1.5, ..Process::paper(Schedule::vp(1)) };
    f.levels = [1; SAMPLES];
    f
}

fn draw(stage: usize, sample: usize, out: &mut [f64]) {
    out.copy_from_slice(&fill(out.len(), (100 + 10 * stage + sample) as u32));
}

impl Fixture {
    fn backward(&self, parameters: &[f64]) -> (ActorLoss, Vec<f64>, ActorTape<f64>) {
        let mut tape = self.actor.tape(&self.critic, &self.dual, SAMPLES, Arc::default());
        let mut gradient = vec![0.0; parameters.len()];
        let mut dual_gradient = vec![0.0; self.dual_parameters.len()];
        let judges = Judges {
            critic: (&self.critic, (&self.critic_parameters).into()),
            dual: (&self.dual, &self.dual_parameters),
        };
        let noise = ActorNoise { levels: &self.levels, cloning: &self.cloning, chain: &draw, second_twin: true };
        let batch = (&self.batch, SAMPLES);
        let loss = self.actor.forward(parameters, judges, batch, &noise, &mut tape);
        let gradients = (&mut gradient[..], &mut dual_gradient[..]);
        self.actor.backward(parameters, judges, batch, self.actor.eta, &mut tape, gradients);
        (loss, gradient, tape)
    }

    fn check(&self) {
        let (.., tape) = self.backward(&self.parameters);
        let clipped = tape.action.iter().filter(|action| action.abs() == 1.0).count();
        assert!(clipped > 0 && clipped < 2 * SAMPLES, "the clip must be met and missed: {clipped}");
        self.check_gradient();
    }

    fn check_gradient(&self) {
        let (_, gradient, _) = self.backward(&self.parameters);
        assert_gradient(&self.parameters, &gradient, |parameters| {
            let (loss, ..) = self.backward(parameters);
            (loss.cloning - self.actor.eta * loss.reward + loss.penalty) / SAMPLES as f64
        });
    }
}

#[test]
fn the_gradient_through_the_full_chain_and_its_clips_is_that_of_finite_differences() {
    fixture(PolicyGradient::Full).check();
}

#[test]
fn the_one_step_gradient_is_that_of_finite_differences() {
    fixture(PolicyGradient::OneStep).check();
}

#[test]
fn the_gradient_under_other_twins_is_that_of_finite_differences() {
    for twins in [Twins::Minimum, Twins::Mean, Twins::Random] {
        let mut f = fixture(PolicyGradient::OneStep);
        f.actor.twins = twins;
        f.check();
    }
}

#[test]
fn the_gradient_with_learnt_frequencies_is_that_of_finite_differences() {
    for policy_gradient in [PolicyGradient::Full, PolicyGradient::OneStep] {
        let mut f = fixture(policy_gradient);
        // So few levels that the steps of finite differences are small against a turn at the last one.
        f.actor.denoiser = Denoiser::new(Widths { steps: 4, ..WIDTHS }, 0.5).with_learned_frequencies();
        f.actor.process = Process::paper(Schedule::vp(4));
        f.levels = [1, 2, 3, 4];
        f.parameters = fill(f.actor.denoiser.size(), 1);
        f.check_gradient();
    }
}

#[test]
fn the_gradients_of_a_gaussian_policy_are_those_of_finite_differences() {
    gaussian(PolicyGradient::Full).check();
    gaussian(PolicyGradient::OneStep).check();
}

/// `a = clip(mean(s, kappa) + std z)`: the mean is what is cloned, and does not see `z`.
#[test]
fn a_gaussian_policy_is_its_mean_plus_noise() {
    let mut f = gaussian(PolicyGradient::Full);
    f.actor.process.gaussian_std = 0.0;
    let mean = f.backward(&f.parameters).2.action;
    f.actor.process.gaussian_std = 0.3;
    let (loss, _, tape) = f.backward(&f.parameters);
    for sample in 0..SAMPLES {
        let mut noise = [0.0; 2];
        draw(0, sample, &mut noise);
        for row in 0..2 {
            let expected = (mean[(row, sample)] + 0.3 * noise[row]).clamp(-1.0, 1.0);
            assert!((tape.action[(row, sample)] - expected).abs() < 1e-12);
        }
    }
    assert!(mean.iter().all(|entry| entry.abs() < 1.0), "no mean is clipped, so the loss is that of the actions");
    let error = |sample: usize| (mean.column(sample) - f.batch.action.column(sample)).norm_squared();
    let expected: f64 = f.batch.weight.iter().enumerate().map(|(sample, weight)| weight * error(sample)).sum();
    assert!((loss.cloning - expected).abs() < 1e-12);
}

/// Through all its steps a chain has a gradient of finite differences (above);
/// one that starts where the last steps start has the gradient of those alone.
#[test]
fn the_last_steps_have_the_gradient_of_a_chain_that_starts_there() {
    let f = fixture(PolicyGradient::Full);
    let denoiser = &f.actor.denoiser;
    let steps = f.actor.process.chain(Sampler::Ddpm, STEPS);
    let seed = DMatrix::from_vec(2, SAMPLES, fill(2 * SAMPLES, 14));
    let run = |steps: &[_], last: usize, draw: &Draw<'_, f64>| {
        let mut context = denoiser.context(SAMPLES);
        denoiser.prepare(&f.parameters, &f.batch.state, &f.batch.kappa, &mut context);
        let mut chain = Chain::new(denoiser, steps.to_vec(), SAMPLES, last);
        chain.run(denoiser, &f.parameters, &context, draw);
        let mut gradient = vec![0.0; f.parameters.len()];
        chain.backward(denoiser, &f.parameters, &mut context, &seed, &mut gradient);
        denoiser.finish(&f.parameters, &f.batch.state, &mut context, &mut gradient);
        (chain.action, gradient)
    };
    let last = f.actor.gradient_steps;
    let (start, _) = run(&steps[..STEPS - last], 0, &draw);
    let tail = |stage: usize, sample: usize, out: &mut [f64]| match stage {
        0 => out.copy_from_slice(start.column(sample).as_slice()),
        _ => draw(stage + STEPS - last, sample, out),
    };
    let expected = run(&steps[STEPS - last..], last, &tail);
    let (action, gradient) = run(&steps, last, &draw);
    assert_eq!((&action, &gradient), (&expected.0, &expected.1));
    assert_ne!(gradient, run(&steps, STEPS, &draw).1, "the first steps have a gradient of their own");
    assert!(gradient.iter().any(|entry| *entry != 0.0));
}

#[test]
fn the_actor_takes_the_policy_gradient_that_it_is_told() {
    let gradients = [PolicyGradient::Full, PolicyGradient::LastK, PolicyGradient::OneStep].map(|policy_gradient| {
        let f = fixture(policy_gradient);
        f.backward(&f.parameters).1
    });
    assert!(gradients[0] != gradients[1] && gradients[1] != gradients[2]);
}

#[test]
fn the_mean_over_action_entries_is_the_sum_divided_by_their_number() {
    let mut f = fixture(PolicyGradient::OneStep);
    let (sum, ..) = f.backward(&f.parameters);
    f.actor.cloning_norm = CloningNorm::Mean;
    let (mean, ..) = f.backward(&f.parameters);
    assert!((sum.cloning - 2.0 * mean.cloning).abs() < 1e-12);
    f.check();
}

#[test]
fn a_sample_weight_scales_its_cloning_loss() {
    let mut f = fixture(PolicyGradient::OneStep);
    f.batch.weight = vec![1.0, 0.0, 0.0, 0.0];
    let (one, ..) = f.backward(&f.parameters);
    f.batch.weight = vec![2.0, 0.0, 0.0, 0.0];
    let (two, ..) = f.backward(&f.parameters);
    assert!(one.cloning > 0.0);
    assert!((two.cloning - 2.0 * one.cloning).abs() < 1e-12);
}

/// Mean and variance at the end of a chain whose network is the exact score of
/// `N(0.2, 0.04)`: every step is linear in the noise, so they follow exactly.
fn moments_with_the_exact_score(sampler: Sampler, steps: usize) -> (f64, f64) {
    let (target_mean, target_variance) = (0.2, 0.04);
    let schedule = Schedule::vp(steps);
    schedule.chain(sampler, steps).fold((0.0, 1.0), |(mean, variance), step| {
        let alpha_bar = schedule.alpha_bar(step.n);
        // E[x0 | a] = mu + gain (a - sqrt(abar) mu)
        let gain = alpha_bar.sqrt() * target_variance / (alpha_bar * target_variance + 1.0 - alpha_bar);
        let slope = step.to_x0 * gain + step.to_action;
        let shift = step.to_x0 * target_mean * (1.0 - gain * alpha_bar.sqrt());
        (slope * mean + shift, slope * slope * variance + step.sigma * step.sigma)
    })
}

/// The mean is met at any length, up to the 0.3 % of the action that is left at
/// the start; the variance is met as the steps become fine, at first order.
#[test]
fn with_the_exact_score_a_chain_reproduces_mean_and_variance() {
    for sampler in [Sampler::Ddpm, Sampler::Ddim] {
        let errors = [20, 80, 320, 1280].map(|steps| {
            let (mean, variance) = moments_with_the_exact_score(sampler, steps);
            assert!((mean - 0.2).abs() < 0.2 * 0.02, "{sampler:?} {steps}: mean {mean}");
            (variance - 0.04).abs()
        });
        assert!(errors.windows(2).all(|pair| pair[1] < 0.5 * pair[0]), "{sampler:?}: {errors:?}");
        assert!(errors[3] < 0.001, "{sampler:?}: {errors:?}");
    }
}
