use super::*;
use crate::Kernel;
use crate::fixture::{Fixture, PAPER, Parts, SMALL, TRAINED_MAX};
use armor_core::image::{Precision, SectionKind};
use armor_core::schedule::Sampler as Kind;
use armor_core::shape::Shape;
use proptest::prelude::*;
use std::vec::Vec;

type Small<'a> = Controller<'a, 8, 4, 16>;

const STATE: [f32; 3] = [0.5, -0.25, 1.0];
const BOUND: f32 = 0.75;

fn limit(d: f32) -> CostLimit {
    CostLimit::new(d).unwrap()
}

fn parts() -> Parts {
    let mut parts = Fixture::random(SMALL, 1);
    parts.set_bounds(-0.5, BOUND);
    parts
}

/// What the fallback of [`parts`] is.
const FALLBACK: [f32; 4] = [0.125, 0.125, 0.0, 0.0];

/// A policy whose sums overflow.
fn diverged() -> Parts {
    let mut parts = parts();
    parts.section(SectionKind::Hidden2).fill(f32::MAX.to_bits());
    parts
}

/// Runs a test on a fresh controller with a limit of 3 and seed 1.
fn fly<T>(parts: Parts, test: impl FnOnce(&mut Small<'_>) -> T) -> T {
    let fixture = parts.build();
    let policy = Policy::load(&fixture.image()).unwrap();
    test(&mut Small::new(policy, limit(3.0), 1).unwrap())
}

fn is_bounded(action: &SVector<f32, 4>) -> bool {
    let [x, y, rest @ ..] = action.as_slice() else { return false };
    [x, y].iter().all(|entry| (-0.5..=BOUND).contains(*entry)) && rest == [0.0, 0.0]
}

#[test]
fn kappa_starts_at_the_limit_falls_by_each_cost_and_stops_at_zero() {
    fly(parts(), |controller| {
        assert_eq!(controller.kappa().to_f32(), 3.0);
        for (cost, kappa) in [(0.0, 3.0), (1.0, 2.0), (0.0, 2.0), (1.5, 0.5), (1.0, 0.0), (0.0, 0.0)] {
            let step = controller.step(&STATE, cost);
            assert_eq!((step.kappa.to_f32(), step.fault), (kappa, None));
            assert_eq!(controller.kappa(), step.kappa);
        }
    });
}

#[test]
fn a_new_episode_refills_the_budget_and_repeats_the_noise() {
    fly(parts(), |controller| {
        let first = controller.step(&STATE, 0.0);
        controller.step(&STATE, 3.0);
        controller.new_episode(limit(3.0), 1).unwrap();
        assert_eq!(controller.step(&STATE, 0.0), first);
    });
}

#[test]
fn the_action_depends_on_seed_tick_state_and_budget_and_on_nothing_else() {
    let fixture = parts().build();
    let policy = Policy::load(&fixture.image()).unwrap();
    let second = |seed, d, state: &[f32], cost| {
        let mut controller = Small::new(policy, limit(d), seed).unwrap();
        let first = controller.step(state, 0.0).action;
        (first, controller.step(state, cost).action)
    };
    let base = second(1, 3.0, &STATE, 0.0);
    assert_eq!(second(1, 3.0, &STATE, 0.0), base);
    assert_ne!(base.0, base.1);
    assert_ne!(second(2, 3.0, &STATE, 0.0), base);
    assert_ne!(second(1, 3.0, &[0.5, -0.25, 1.01], 0.0), base);
    assert_ne!(second(1, 3.0, &STATE, 0.5).1, base.1);
    // A budget of 2.5 is a budget of 2.5, however it came about.
    assert_eq!(second(1, 3.0, &STATE, 0.5).1, second(1, 2.5, &STATE, 0.0).1);
}

/// A step that failed leaves nothing behind but its tick.
#[test]
fn a_fault_does_not_change_the_actions_after_it() {
    let after = |state: &[f32]| {
        fly(parts(), |controller| {
            controller.step(state, 0.0);
            controller.step(&STATE, 0.0)
        })
    };
    let undisturbed = after(&STATE);
    assert_eq!(after(&[]), undisturbed);
    assert_eq!(after(&[f32::NAN; 3]), undisturbed);
    assert_eq!(after(&[f32::MAX; 3]), undisturbed);
}

#[test]
fn every_fault_gives_its_action() {
    const NAN: f32 = f32::NAN;
    let policy_at_zero = fly(parts(), |controller| controller.step(&STATE, 3.0).action);
    let fallback = SVector::from(FALLBACK);
    assert_ne!(policy_at_zero, fallback);
    let check = |parts: Parts, state: &[f32], cost, fault, action, kappa| {
        let step = fly(parts, |controller| controller.step(state, cost));
        let rung = (fault == Fault::InvalidCost).then_some(0);
        assert_eq!(step, Step { action, kappa: Cost::from_incurred(kappa).unwrap(), rung, fault: Some(fault) });
    };
    check(parts(), &STATE[..2], 1.0, Fault::StateLength, fallback, 2.0);
    check(parts(), &[0.0; 4], 0.0, Fault::StateLength, fallback, 3.0);
    check(parts(), &[0.0, NAN, 0.0], 1.0, Fault::StateNotFinite, fallback, 2.0);
    check(parts(), &[0.0, 0.0, f32::INFINITY], 0.0, Fault::StateNotFinite, fallback, 3.0);
    check(parts(), &STATE, NAN, Fault::InvalidCost, policy_at_zero, 0.0);
    check(parts(), &STATE, -1.0, Fault::InvalidCost, policy_at_zero, 0.0);
    check(diverged(), &STATE, 1.0, Fault::ActionNotFinite, fallback, 2.0);
    // Two at a time: the one that decided the action is named.
    check(parts(), &[], NAN, Fault::StateLength, fallback, 0.0);
    check(parts(), &[NAN; 3], f32::INFINITY, Fault::StateNotFinite, fallback, 0.0);
    check(diverged(), &STATE, -1.0, Fault::ActionNotFinite, fallback, 0.0);
}

#[test]
fn the_longest_rung_within_the_callers_steps_flies() {
    let flown = |rungs: &[(Kind, u16)], steps: usize| {
        let mut parts = parts();
        parts.set_rungs(rungs);
        fly(parts, |controller| controller.step_within(&STATE, 0.0, steps))
    };
    let ladder = [(Kind::Ddpm, 5), (Kind::Ddim, 3), (Kind::Ddim, 1)];
    for (steps, rung) in [(usize::MAX, 0), (5, 0), (4, 1), (3, 1), (2, 2), (1, 2)] {
        let step = flown(&ladder, steps);
        assert_eq!((step.rung, step.fault), (Some(rung), None));
        assert_eq!(step.action, flown(&ladder[rung..=rung], usize::MAX).action);
    }
    let none = flown(&ladder, 0);
    assert_eq!((none.rung, none.fault, none.action), (None, Some(Fault::NoRung), SVector::from(FALLBACK)));
    let all = fly(parts(), |controller| (controller.step(&STATE, 0.0), controller.kappa()));
    assert_eq!(all, fly(parts(), |controller| (controller.step_within(&STATE, 0.0, usize::MAX), controller.kappa())));
}

#[test]
fn a_policy_that_does_not_fit_is_refused() {
    let fixture = Fixture::random(PAPER, 1).build();
    let policy = Policy::load(&fixture.image()).unwrap();
    assert!(Controller::<7, 2, 256>::new(policy, limit(5.0), 1).is_ok());
    assert_eq!(
        Controller::<6, 2, 256>::new(policy, limit(5.0), 1).map(drop),
        Err(LoadError::StateCapacity { needed: 7, capacity: 6 })
    );
    assert_eq!(
        Controller::<7, 1, 256>::new(policy, limit(5.0), 1).map(drop),
        Err(LoadError::ActionCapacity { needed: 2, capacity: 1 })
    );
    assert_eq!(
        Controller::<7, 2, 255>::new(policy, limit(5.0), 1).map(drop),
        Err(LoadError::HiddenCapacity { needed: 256, capacity: 255 })
    );
}

#[test]
fn a_kappa_embedding_wider_than_the_denoiser_counts_too() {
    for shape in [Shape { kappa_hidden: 17, ..SMALL }, Shape { kappa_embedding: 17, ..SMALL }] {
        let fixture = Fixture::random(shape, 1).build();
        let policy = Policy::load(&fixture.image()).unwrap();
        let error = Small::new(policy, limit(3.0), 1).map(drop);
        assert_eq!(error, Err(LoadError::HiddenCapacity { needed: 17, capacity: 16 }));
    }
}

#[test]
fn a_limit_above_the_trained_range_is_refused_and_changes_nothing() {
    let fixture = parts().build();
    let policy = Policy::load(&fixture.image()).unwrap();
    let above = limit(TRAINED_MAX + 0.5);
    let trained_max = limit(TRAINED_MAX).cost();
    let error = LoadError::LimitAboveTrainedRange { limit: above.cost(), trained_max };
    assert_eq!(Small::new(policy, above, 1).map(drop), Err(error));
    let mut controller = Small::new(policy, limit(TRAINED_MAX), 1).unwrap();
    controller.step(&STATE, 1.0);
    assert_eq!(controller.new_episode(above, 1), Err(error));
    assert_eq!(controller.kappa(), limit(TRAINED_MAX - 1.0).cost());
}

/// Any f32 at all, and the ordinary ones often.
fn any_float() -> impl Strategy<Value = f32> {
    prop_oneof![any::<u32>().prop_map(f32::from_bits), -10.0f32..10.0]
}

proptest! {
    #[test]
    fn whatever_is_reported_the_action_is_bounded_and_kappa_never_grows(
        steps in proptest::collection::vec((proptest::collection::vec(any_float(), 2..5), any_float()), 1..16),
        diverges in any::<bool>(),
    ) {
        let parts = if diverges { diverged() } else { parts() };
        fly(parts, |controller| {
            for (state, cost) in &steps {
                let before = controller.kappa();
                let step = controller.step(state, *cost);
                prop_assert!(is_bounded(&step.action), "{:?}", step.action);
                prop_assert!(step.kappa <= before);
                let well_formed = state.len() == 3 && state.iter().all(|value| value.is_finite());
                prop_assert!(well_formed || step.fault.is_some());
            }
            Ok(())
        })?;
    }
}

/// Recorded from this controller, on x86-64: the bits of two actions of a
/// random policy of the paper's size. They may not change with the machine,
/// the compiler or its options.
#[test]
fn the_bits_of_an_action_do_not_change() {
    let mut parts = Fixture::random(PAPER, 1);
    parts.set_bounds(-100.0, 100.0);
    let fixture = parts.build();
    let policy = Policy::load(&fixture.image()).unwrap();
    let mut controller = Controller::<7, 2, 256>::new(policy, limit(5.0), 1).unwrap();
    let mut bits = Vec::new();
    for _ in 0..2 {
        bits.extend(controller.step(&[0.1; 7], 0.0).action.iter().map(|entry| entry.to_bits()));
    }
    assert_eq!(bits, [1_103_087_370, 1_103_070_781, 3_223_605_209, 3_228_845_123]);
}

const INTEGERS: [Precision; 2] = [Precision::Int16x8, Precision::Int8];

/// An episode of an integer policy on a kernel: the bits of its actions.
fn integer_episode(mut parts: Parts, kernel: Kernel) -> Vec<u32> {
    let shape = parts.manifest.shape;
    parts.set_bounds(-100.0, 100.0);
    let fixture = parts.build();
    let policy = Policy::load(&fixture.image()).unwrap().with_kernel(kernel);
    let mut controller = Controller::<64, 8, 256>::new(policy, limit(5.0), 1).unwrap();
    let state = |tick: usize| (0..shape.state.into()).map(move |i| (tick * 7 + i * 3) as f32 % 11.0 - 5.0);
    let mut bits = Vec::new();
    for tick in 0..4 {
        let step = controller.step(&state(tick).collect::<Vec<f32>>(), 0.5);
        assert_eq!(step.fault, None);
        bits.extend(step.action.iter().take(shape.action.into()).map(|entry| entry.to_bits()));
    }
    bits
}

#[test]
fn an_integer_policy_flies_the_same_bits_on_every_kernel_and_in_both_layouts() {
    // Widths with and without a rest after whole vectors.
    let odd = Shape { state: 61, action: 3, hidden: 139, kappa_hidden: 9, kappa_embedding: 41, steps: 7 };
    for shape in [PAPER, odd, SMALL] {
        for precision in INTEGERS {
            let parts = Fixture::integers(shape, precision, 1);
            let portable = integer_episode(parts.clone(), Kernel::Portable);
            assert!(portable.windows(2).all(|pair| pair[0] != pair[1]), "{portable:?} does not move");
            for kernel in Kernel::available() {
                assert_eq!(integer_episode(parts.clone(), kernel), portable, "{}", kernel.name());
                assert_eq!(integer_episode(parts.clone().paired(), kernel), portable, "{}", kernel.name());
            }
        }
    }
}

/// Recorded from this controller, on x86-64; neither the machine nor the
/// compiler may change them.
#[test]
fn the_bits_of_an_integer_action_do_not_change() {
    let first = |precision| integer_episode(Fixture::integers(PAPER, precision, 1), Kernel::best())[..2].to_vec();
    assert_eq!(INTEGERS.map(first), [[1_109_228_197, 3_234_605_074], [1_109_194_283, 3_234_741_589]]);
}

#[test]
fn a_state_or_embedding_that_has_no_codes_is_a_fault() {
    for precision in INTEGERS {
        let infinite = fly(Fixture::integers(SMALL, precision, 1), |controller| controller.step(&[f32::MAX; 3], 0.0));
        assert_eq!(infinite.fault, None, "the normaliser of the fixture halves");
        let mut parts = Fixture::integers(SMALL, precision, 1);
        parts.section(SectionKind::StateNormaliser)[3..].fill(4f32.to_bits());
        let overflow = fly(parts.clone(), |controller| controller.step(&[f32::MAX; 3], 0.0));
        assert_eq!((overflow.fault, overflow.action.as_slice()), (Some(Fault::ActionNotFinite), &[0.0; 4][..]));
        parts.section(SectionKind::Kappa3).fill(f32::MAX.to_bits());
        let overflow = fly(parts, |controller| controller.step(&STATE, 0.0));
        assert_eq!(overflow.fault, Some(Fault::ActionNotFinite));
    }
}

#[test]
fn a_state_of_zeros_is_a_state() {
    for precision in INTEGERS {
        let mut parts = Fixture::integers(SMALL, precision, 1);
        parts.section(SectionKind::StateNormaliser)[..3].fill(0);
        let step = fly(parts, |controller| controller.step(&[0.0; 3], 0.0));
        assert_eq!(step.fault, None);
    }
}
