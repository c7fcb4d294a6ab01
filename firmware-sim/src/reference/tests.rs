use armor_core::image::SectionKind;
use armor_core::schedule::Schedule;
use armor_core::units::CostLimit;
use armor_infer::Policy;

use super::*;
use crate::fixture::{BALL_RUN, Parts};
use crate::host::HostController;
use crate::memory::AlignedBytes;

const SEED: u64 = 5;
const STATE: [f32; 7] = [0.1, -0.2, 0.5, 0.0, 0.3, -0.7, 0.2];

fn with_image<T>(parts: &Parts, act: impl FnOnce(&PolicyImage<'_>) -> T) -> T {
    let memory = AlignedBytes::from(parts.bytes().as_slice());
    act(&PolicyImage::new_checked(memory.as_slice()).unwrap())
}

#[test]
fn it_agrees_with_the_controller_to_single_precision() {
    for seed in 0..20 {
        with_image(&Parts::random("ball-run", BALL_RUN, seed), |image| {
            let limit = CostLimit::new(7.0).unwrap();
            let mut controller = HostController::new(Policy::load(image).unwrap(), limit, SEED).unwrap();
            let reference = Reference::new(image);
            for tick in 0..5 {
                let step = controller.step(&STATE, 1.0);
                let chain = reference.chain(step.rung.unwrap(), &STATE, step.kappa, SEED, tick);
                for (entry, expected) in step.action.iter().zip(chain.action) {
                    assert!((f64::from(*entry) - expected).abs() < 2e-5, "{entry} is not {expected}");
                }
            }
        });
    }
}

/// Between, on and beyond the knots, where the budget falls by 1 a step.
#[test]
fn it_agrees_with_the_controller_on_a_budget_map() {
    let mut parts = Parts::random("ball-run", BALL_RUN, 3);
    let knots = [(1.5f32, -2.0f32), (3.0, 4.0), (5.25, 9.0)];
    let raw = |budget: f32| CostLimit::new(budget).unwrap().cost().to_raw();
    *parts.section(SectionKind::BudgetMap) =
        knots.iter().flat_map(|&(budget, condition)| [raw(budget), condition.to_bits()]).collect();
    let conditions = with_image(&parts, |image| {
        let mut controller =
            HostController::new(Policy::load(image).unwrap(), CostLimit::new(7.0).unwrap(), SEED).unwrap();
        let Reference::Float(reference) = Reference::new(image) else { panic!("the fixture is in single precision") };
        (0..7)
            .map(|tick| {
                let step = controller.step(&STATE, f32::from(tick > 0));
                let chain = reference.chain(step.rung.unwrap(), &STATE, step.kappa, [SEED, tick], 0);
                for (entry, expected) in step.action.iter().zip(chain.action) {
                    assert!((f64::from(*entry) - expected).abs() < 2e-5, "{entry} is not {expected}");
                }
                reference.condition(step.kappa)
            })
            .collect::<Vec<_>>()
    });
    let expected = [9.0, 9.0, 4.0 + 2.0 / 2.25 * 5.0, 4.0 + 1.0 / 2.25 * 5.0, 4.0, 0.0, -2.0];
    for (found, expected) in conditions.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-12, "{conditions:?}");
    }
}

/// A network that always says `eps = 0.5`: the deterministic chain keeps
/// its first estimate, `(a^N - sqrt(1 - abar_N) / 2) / sqrt(abar_N)`, clipped.
#[test]
fn the_deterministic_chain_of_a_constant_network_has_a_closed_form() {
    let mut parts = Parts::random("ball-run", BALL_RUN, 1);
    let output = parts.section(SectionKind::Output);
    let biases = output.len() - 2;
    output.fill(0);
    output[biases..].fill(0.5f32.to_bits());
    let bounds = [-1e3f32, 1e3, 0.0].map(|bound| [bound.to_bits(); 2]);
    *parts.section(SectionKind::ActionBounds) = bounds.concat();
    let chain = with_image(&parts, |image| Reference::new(image).chain(1, &STATE, Cost::ZERO, SEED, 3));
    let mut start = [0.0; 2];
    Noise::new(SEED).fill_normal(0, 3, &mut start);
    let abar = Schedule::vp(5).alpha_bar(5);
    for (entry, start) in start.into_iter().map(f64::from).enumerate() {
        let expected = (start - 0.5 * (1.0 - abar).sqrt()) / abar.sqrt();
        assert!((chain.action[entry] - expected).abs() < 1e-5 * expected.abs(), "{chain:?}");
        assert_eq!(chain.start[entry], start);
    }
    assert_eq!(chain.steps.iter().map(|step| step.n).collect::<Vec<_>>(), [5, 3]);
    assert!(chain.steps.iter().all(|step| step.eps == [0.5; 2] && step.noise == [0.0; 2]));
}

#[test]
fn each_row_follows_from_the_one_before_by_eq_12() {
    let parts = Parts::random("ball-run", BALL_RUN, 1);
    let chain = with_image(&parts, |image| Reference::new(image).chain(0, &STATE, Cost::ZERO, SEED, 0));
    let schedule = Schedule::vp(5);
    let mut before = chain.start.clone();
    for row in &chain.steps {
        let (here, there) = (schedule.alpha_bar(row.n), schedule.alpha_bar(row.n - 1));
        let beta = schedule.beta(row.n);
        for (entry, before) in before.iter().enumerate() {
            let estimate = (before - (1.0 - here).sqrt() * row.eps[entry]) / here.sqrt();
            let x0 = estimate.clamp(-1.0, 1.0);
            assert!((row.x0[entry] - x0).abs() < 1e-6);
            let mean =
                beta * there.sqrt() / (1.0 - here) * x0 + (1.0 - there) * (here / there).sqrt() / (1.0 - here) * before;
            let sigma = (beta * (1.0 - there) / (1.0 - here)).sqrt();
            assert!((row.action[entry] - mean - sigma * row.noise[entry]).abs() < 1e-6);
        }
        before.clone_from(&row.action);
    }
    assert_eq!(before, chain.action);
}

/// What is flown is a candidate that the reference's own critic lets win, and
/// the budget matters: with it the choice changes.
#[test]
fn it_agrees_with_the_choice_among_candidates() {
    const COUNT: usize = 8;
    let mut differ = 0;
    for seed in 0..20 {
        with_image(&Parts::random("ball-run", BALL_RUN, seed).with_critic(seed), |image| {
            let reference = Reference::new(image);
            let critic = CriticReference::new(image.critic().unwrap());
            let chosen = [0.0, 30.0].map(|budget| {
                let limit = CostLimit::new(budget).unwrap();
                let mut pilot = crate::host::pilot(image, limit, SEED, COUNT as u8).unwrap();
                let step = pilot.step_within(&STATE, 0.0, usize::MAX);
                let asked = (&critic, COUNT as u32);
                let candidates = reference.candidates(asked, step.rung.unwrap(), &STATE, step.kappa, [SEED, 0]);
                let estimates: Vec<Estimate> = candidates.iter().map(|(_, estimate)| *estimate).collect();
                let taken = candidates.iter().position(|(action, _)| {
                    step.action.iter().zip(action).all(|(taken, entry)| (f64::from(*taken) - entry).abs() < 2e-5)
                });
                let taken = taken.expect("the action is none of the candidates");
                assert!(estimates[taken].may_win(&estimates, 1e-5), "seed {seed}: {taken} of {estimates:?}");
                // Where the tolerance could hide a wrong choice, this would not be a test.
                let winners = estimates.iter().filter(|estimate| estimate.may_win(&estimates, 1e-5));
                // Candidates on the same bounds are one.
                assert!(winners.into_iter().all(|one| *one == estimates[taken]), "seed {seed}: {estimates:?}");
                taken
            });
            differ += usize::from(chosen[0] != chosen[1]);
        });
    }
    assert!(differ > 0);
}
