use armor_core::image::SectionKind;
use armor_core::shape::Shape;

use super::*;
use crate::fixture::{self, BALL_RUN, Parts, TRAINED_MAX};
use crate::memory::AlignedBytes;
use crate::plant::BallRun;

fn plan(episodes: u32) -> FlightPlan {
    let limit = CostLimit::new(5.0).unwrap();
    FlightPlan { task: Task::named("ball-run").unwrap(), limit, episodes, seed: 1, rate_hz: 30, max_steps: usize::MAX }
}

fn fly_bytes(bytes: &[u8], plan: &FlightPlan) -> Result<Flight, FlightError> {
    let memory = AlignedBytes::from(bytes);
    fly(&PolicyImage::new_checked(memory.as_slice()).unwrap(), plan)
}

fn flown(plan: &FlightPlan) -> Vec<Episode> {
    fly_bytes(&fixture::ball_run(1), plan).unwrap().episodes
}

/// What a flight brings apart from host time.
fn timeless(episodes: &[Episode]) -> Vec<Episode> {
    let mut episodes = episodes.to_vec();
    for tick in episodes.iter_mut().flat_map(|episode| &mut episode.ticks) {
        tick.latency = Duration::ZERO;
    }
    episodes
}

#[test]
fn an_episode_does_not_depend_on_how_many_are_flown() {
    let (two, three) = (timeless(&flown(&plan(2))), timeless(&flown(&plan(3))));
    assert_eq!(two, three[..2]);
    assert_ne!(three[1], three[2]);
    assert_ne!(timeless(&flown(&FlightPlan { seed: 2, ..plan(2) })), two);
}

/// Flies the recorded actions again, on a plant of its own.
#[test]
fn what_is_told_of_an_episode_is_what_its_actions_do_to_the_plant() {
    for (rate_hz, hold, period) in [(30, 1, 33_333), (15, 2, 66_666), (10, 3, 100_000)] {
        let mut plant = BallRun::default();
        for (index, episode) in (0..).zip(flown(&FlightPlan { rate_hz, ..plan(2) })) {
            plant.reset(episode_seed(1, Use::Plant, index));
            let mut kappa: f64 = 5.0;
            let mut steps = 0;
            for (tick, time) in episode.ticks.iter().zip((0..).step_by(period)) {
                assert_eq!((tick.time, tick.step.kappa.to_f32()), (Micros(time), kappa as f32));
                let held = hold.min(100 - steps);
                let outcomes: Vec<_> = (0..held).map(|_| plant.step(&tick.step.action.as_slice()[..2])).collect();
                steps += held;
                assert_eq!(tick.reward, outcomes.iter().map(|outcome| outcome.reward).sum::<f64>());
                assert_eq!(tick.cost, outcomes.iter().map(|outcome| outcome.cost).sum::<f64>());
                kappa = (kappa - tick.cost).max(0.0);
            }
            assert_eq!(steps, 100);
        }
    }
}

#[test]
fn a_policy_that_cannot_be_computed_falls_back_and_every_fault_is_counted() {
    let mut parts = Parts::random("ball-run", BALL_RUN, 1);
    parts.section(SectionKind::Output).fill(f32::MAX.to_bits());
    let flight = fly_bytes(&parts.bytes(), &plan(2)).unwrap();
    assert_eq!((flight.summary.actions, flight.summary.faults), (200, 200));
    // The fallback is 0, and a resting ball stays.
    assert_eq!((flight.summary.reward, flight.summary.cost), (0.0, 0.0));
    assert!(flight.episodes[0].faults().all(|fault| fault == Fault::ActionNotFinite));
}

#[test]
fn an_image_that_does_not_fit_is_refused_by_name() {
    let refused = |parts: Parts| fly_bytes(&parts.bytes(), &plan(1)).unwrap_err();
    let other_task = refused(Parts::random("point-goal", BALL_RUN, 1));
    assert_eq!(other_task, FlightError::WrongTask { image: "point-goal".into(), task: "ball-run" });
    let other_size = refused(Parts::random("ball-run", Shape { state: 8, ..BALL_RUN }, 1));
    assert!(matches!(other_size, FlightError::WrongSize { state: 8, action: 2, expected_state: 7, .. }));
}

#[test]
fn a_plan_that_cannot_be_flown_is_refused_by_name() {
    let refused = |plan: FlightPlan| fly_bytes(&fixture::ball_run(1), &plan).unwrap_err();
    for rate_hz in [0, 7, 60, 1_000_001] {
        assert!(
            matches!(refused(FlightPlan { rate_hz, ..plan(1) }), FlightError::Rate { rate, .. } if rate == rate_hz)
        );
    }
    let limit = CostLimit::new(TRAINED_MAX + 1.0).unwrap();
    assert!(matches!(
        refused(FlightPlan { limit, ..plan(1) }),
        FlightError::Load(LoadError::LimitAboveTrainedRange { .. })
    ));
    let simulator = FlightPlan { task: Task::named("SafetyBallRun-v0").unwrap(), ..plan(1) };
    let bytes = Parts::random("SafetyBallRun-v0", BALL_RUN, 1).bytes();
    let refused = fly_bytes(&bytes, &simulator).unwrap_err();
    assert_eq!(refused, FlightError::Task(TaskError::NotNative { task: "SafetyBallRun-v0" }));
}
