use super::*;
use crate::controller::{Controller, Fault};
use crate::fixture;
use crate::fixture::{Fixture, Parts, SMALL};
use crate::kernel::Kernel;
use armor_core::image::{Precision, SectionKind};
use armor_core::noise::Noise;
use armor_core::schedule::Sampler as Kind;
use std::vec::Vec;

const TRUNK: usize = 6;
const HEAD: usize = 5;
const STATE: [f32; 3] = [0.5, -0.25, 1.0];
const K: usize = 4;

fn limit() -> CostLimit {
    CostLimit::new(3.0).unwrap()
}

/// A critic with random weights.
fn with_critic(mut parts: Parts) -> Parts {
    let numbers = (3 + 1 + 2 + 1) * TRUNK + (TRUNK + 1) * TRUNK + 4 * ((TRUNK + 1) * HEAD + HEAD + 1);
    let mut values = std::vec![0.0; numbers];
    Noise::new(8).fill_normal(200, 0, &mut values);
    let header = [TRUNK as u32, HEAD as u32, 0.05f32.to_bits(), 1f32.to_bits()];
    *parts.section(SectionKind::Critic) =
        header.into_iter().chain(values.iter().map(|value| (0.5 * value).to_bits())).collect();
    parts
}

/// The words of a critic of zeros whose trunk has `trunk` units.
fn wide_critic(trunk: usize) -> Vec<u32> {
    let numbers = (3 + 1 + 2 + 1) * trunk + (trunk + 1) * trunk + 4 * ((trunk + 1) * HEAD + HEAD + 1);
    [trunk as u32, HEAD as u32, 0, 1f32.to_bits()].into_iter().chain(core::iter::repeat_n(0, numbers)).collect()
}

/// The critic whose estimates are constants: reward 0, cost `cost`.
fn with_constant_critic(parts: Parts, cost: f32) -> Parts {
    let mut parts = with_critic(parts);
    let words = parts.section(SectionKind::Critic);
    words[4..].fill(0);
    let last = words.len() - 1;
    words[last] = cost.to_bits();
    words[last - (TRUNK + 1) * HEAD - HEAD - 1] = cost.to_bits();
    parts
}

fn estimate(reward: f32, cost: f32) -> Estimate {
    Estimate { reward, cost }
}

#[test]
fn within_the_budget_reward_decides_and_beyond_it_cost() {
    let choose = |estimates: [(f32, f32); 3]| best(estimates.map(|(reward, cost)| estimate(reward, cost)), 2.0);
    assert_eq!(choose([(1.0, 0.0), (3.0, 2.0), (2.0, 1.0)]), Some(1));
    assert_eq!(choose([(1.0, 0.0), (3.0, 2.1), (2.0, 1.0)]), Some(2));
    assert_eq!(choose([(9.0, 4.0), (8.0, 3.0), (-5.0, 2.0)]), Some(2));
    assert_eq!(choose([(9.0, 4.0), (8.0, 3.0), (7.0, 5.0)]), Some(1));
    assert_eq!(choose([(1.0, 1.0), (1.0, 0.0), (1.0, 1.0)]), Some(0));
    assert_eq!(choose([(1.0, 4.0), (2.0, 4.0), (1.0, 4.0)]), Some(0));
    assert_eq!(choose([(f32::NAN, 0.0), (1.0, f32::INFINITY), (0.0, 9.0)]), Some(2));
    assert_eq!(choose([(f32::NAN, 0.0), (1.0, f32::NAN), (f32::INFINITY, 0.0)]), None);
}

/// The candidates a step chooses from, each by the plain chain on its own noise.
fn alone(parts: &Parts, steps: usize) -> [Vec<u32>; K] {
    let fixture = parts.clone().build();
    let image = fixture.image();
    let policy = Policy::load(&image).unwrap();
    let mut all = ControlLoop::<8, 4, 16, K>::new(policy, limit(), 7).unwrap();
    core::array::from_fn(|candidate| {
        all.new_episode(limit(), 7).unwrap();
        let step = all.step(&STATE, 0.5, steps, |_| Ok(candidate));
        step.action.iter().map(|value| value.to_bits()).collect()
    })
}

#[test]
fn the_first_candidate_is_the_plain_controllers_action_and_the_others_differ() {
    let float = || Fixture::random(SMALL, 1);
    let integer = || Fixture::integers(SMALL, Precision::Int8, 1);
    for mut parts in [float(), integer(), Fixture::integers(SMALL, Precision::Int16x8, 1)] {
        parts.set_rungs(&[(Kind::Ddpm, 5), (Kind::Ddim, 2)]);
        // Wide enough that no two candidates lie on the same bounds.
        parts.set_bounds(-1e3, 1e3);
        for steps in [5, 2] {
            let candidates = alone(&parts, steps);
            let fixture = parts.clone().build();
            let policy = Policy::load(&fixture.image()).unwrap();
            let mut plain = Controller::<8, 4, 16>::new(policy, limit(), 7).unwrap();
            let step = plain.step_within(&STATE, 0.5, steps);
            assert_eq!(candidates[0], step.action.map(f32::to_bits).as_slice());
            for (i, one) in candidates.iter().enumerate() {
                assert!(candidates[..i].iter().all(|other| one[..2] != other[..2]), "{candidates:x?}");
            }
        }
    }
}

#[test]
fn a_candidate_has_the_bits_of_its_chain_alone_on_every_kernel() {
    let parts = Fixture::random(fixture::PAPER, 3);
    let fixture = parts.build();
    let image = fixture.image();
    let state: [f32; 7] = core::array::from_fn(|i| i as f32 / 8.0 - 0.5);
    let mut seen: Option<Vec<u32>> = None;
    for kernel in Kernel::available() {
        let policy = Policy::load(&image).unwrap().with_kernel(kernel);
        let action = |candidate| {
            let mut all = ControlLoop::<8, 4, 256, 5>::new(policy, limit(), 7).unwrap();
            all.step(&state, 0.5, usize::MAX, |_| Ok(candidate)).action.map(f32::to_bits)
        };
        let actions: Vec<u32> = (0..5).flat_map(|candidate| action(candidate).data.0[0]).collect();
        assert!(seen.get_or_insert_with(|| actions.clone()) == &actions, "{}", kernel.name());
    }
}

#[test]
fn the_answer_is_a_candidate_and_the_budget_decides_which() {
    for parts in [Fixture::random(SMALL, 1), Fixture::integers(SMALL, Precision::Int8, 1)] {
        let candidates = alone(&parts, 5);
        let mut chosen = Vec::new();
        for cost in [0.0f32, 1e6] {
            // A critic that finds everything dear and one that finds everything cheap.
            let mut parts = with_critic(parts.clone());
            let words = parts.section(SectionKind::Critic);
            let last = words.len() - 1;
            words[last] = cost.to_bits();
            let fixture = parts.build();
            let mut controller = BestOf::<8, 4, 16, K>::new(&fixture.image(), limit(), 7).unwrap();
            let step = controller.step(&STATE, 0.5);
            assert_eq!((step.fault, step.kappa.to_f32()), (None, 2.5));
            let action: Vec<u32> = step.action.iter().map(|value| value.to_bits()).collect();
            chosen.push(candidates.iter().position(|candidate| *candidate == action).unwrap());
            // The next step finds the denoiser's memory as it was.
            let next = controller.step(&STATE, 0.0);
            controller.new_episode(limit(), 7).unwrap();
            assert_eq!(controller.step(&STATE, 0.5).action, step.action);
            assert_eq!(controller.step(&STATE, 0.0).action, next.action);
        }
        assert_ne!(chosen[0], chosen[1]);
    }
}

#[test]
fn a_critic_that_says_nothing_finite_is_a_fault_and_equals_fall_to_the_first() {
    let answer = |cost: f32| {
        let fixture = with_constant_critic(Fixture::random(SMALL, 1), cost).build();
        let image = fixture.image();
        let mut controller = BestOf::<8, 4, 16, K>::new(&image, limit(), 7).unwrap();
        controller.step(&STATE, 0.5)
    };
    let plain = alone(&Fixture::random(SMALL, 1), 5);
    for cost in [0.0, 100.0] {
        let step = answer(cost);
        assert_eq!(step.action.map(f32::to_bits).as_slice(), plain[0]);
    }
    let mut parts = with_critic(Fixture::random(SMALL, 1));
    parts.section(SectionKind::Critic)[4..].fill(f32::MAX.to_bits());
    let fixture = parts.build();
    let mut controller = BestOf::<8, 4, 16, K>::new(&fixture.image(), limit(), 7).unwrap();
    let step = controller.step(&STATE, 0.5);
    assert_eq!((step.fault, step.rung), (Some(Fault::ActionNotFinite), None));
    assert_eq!(step.action.as_slice(), [0.0; 4]);
}

#[test]
fn an_image_without_a_critic_or_with_too_wide_a_one_is_named() {
    let fixture = Fixture::random(SMALL, 1).build();
    let error = BestOf::<8, 4, 16, K>::new(&fixture.image(), limit(), 7).err();
    assert_eq!(error, Some(LoadError::NoCritic));
    let fixture = with_critic(Fixture::random(SMALL, 1)).build();
    assert!(BestOf::<8, 4, 8, K>::new(&fixture.image(), limit(), 7).is_ok());
    let mut wide = with_critic(Fixture::random(SMALL, 1));
    *wide.section(SectionKind::Critic) = wide_critic(9);
    let error = BestOf::<8, 4, 8, K>::new(&wide.build().image(), limit(), 7).err();
    assert_eq!(error, Some(LoadError::HiddenCapacity { needed: 9, capacity: 8 }));
    let too_high = CostLimit::new(fixture::TRAINED_MAX + 1.0).unwrap();
    let error = BestOf::<8, 4, 16, K>::new(&fixture.image(), too_high, 7).err();
    assert!(matches!(error, Some(LoadError::LimitAboveTrainedRange { .. })));
}
