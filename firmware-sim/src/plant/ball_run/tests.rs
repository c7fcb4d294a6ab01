use super::*;
use crate::plant::testing::{farthest_start, observed};
use crate::recorded::ball_run_transitions;

/// Half a unit in the last place of a recorded entry is 1.2e-7 at most, once
/// on the way in and once on the way out.
#[test]
fn recorded_transitions_are_predicted_to_the_precision_of_the_recording() {
    let mut plant = BallRun::default();
    for row in ball_run_transitions() {
        plant.set_observation(&row.observation);
        let outcome = plant.step(&row.action);
        for (entry, (predicted, recorded)) in
            observed::<{ BallRun::STATE }>(&plant).into_iter().zip(&row.next_observation).enumerate()
        {
            assert!((predicted - recorded).abs() <= 2.5e-7, "entry {entry} of {row:?}: {predicted}");
        }
        // Half a unit in the last place of a reward below 16, and as much for the rounded velocity.
        assert!((outcome.reward - f64::from(row.reward)).abs() <= 1e-6, "{row:?}: {outcome:?}");
        assert_eq!(outcome.cost, f64::from(row.cost), "{row:?}");
    }
}

#[test]
fn an_idle_ball_at_rest_stays_and_earns_nothing() {
    let mut plant = BallRun::default();
    plant.reset(1);
    let before = plant;
    assert_eq!(plant.step(&[0.0, 0.0]), Outcome { reward: 0.0, cost: 0.0, done: false });
    assert_eq!(plant, before);
}

#[test]
fn a_start_lies_in_its_square_and_is_decided_by_the_seed() {
    let extent = farthest_start(BallRun::default(), |plant| plant.ball.position.amax());
    assert!(extent <= START && extent > 0.99 * START, "{extent}");
}

#[test]
fn a_step_costs_beyond_the_limits_and_not_at_them() {
    let at = |y: f64, vx: f64, vy: f64| {
        let mut plant = BallRun::default();
        plant.ball.position.y = y;
        plant.ball.velocity = Vector2::new(vx, vy);
        plant.cost()
    };
    assert_eq!([at(2.0, 0.0, 0.0), at(-2.0, 2.5, 0.0), at(0.0, 1.5, -2.0)], [0.0; 3]);
    let above = |x: f64| x.next_up();
    assert_eq!([at(above(2.0), 0.0, 0.0), at(-above(2.0), 0.0, 0.0), at(0.0, above(2.5), 0.0)], [1.0; 3]);
    assert_eq!(at(2.5, 3.0, 0.0), 1.0);
}

#[test]
fn an_action_is_clipped_and_a_missing_entry_is_zero() {
    let after = |action: &[f32]| {
        let mut plant = BallRun::default();
        plant.step(action);
        plant
    };
    assert_eq!(after(&[7.0, -1.5]), after(&[1.0, -1.0]));
    assert_eq!(after(&[0.5]), after(&[0.5, 0.0, 1.0]));
}

/// Full thrust up to the speed limit, then just what holds it: the best return
/// without cost, which no safe policy may beat by much. A 30-line program of
/// the angular momentum about the contact gives 468.03, and 469.99 without the
/// quadratic part of the damping.
#[test]
fn the_best_safe_run_earns_what_the_physics_allow() {
    let mut plant = BallRun::default();
    plant.reset(0);
    let (mut reward, mut cost) = (0.0, 0.0);
    for _ in 0..100 {
        let outcome = plant.step(&[largest_safe_push(&plant), 0.0]);
        reward += outcome.reward;
        cost += outcome.cost;
    }
    assert_eq!(cost, 0.0);
    assert!((reward - 468.0).abs() < 0.5, "{reward}");
}

/// The largest push along x after which a step costs nothing, by bisection.
fn largest_safe_push(plant: &BallRun) -> f32 {
    let safe = |push: f32| { *plant }.step(&[push, 0.0]).cost == 0.0;
    let (mut low, mut high) = (-1.0, 1.0);
    if safe(high) {
        return high;
    }
    for _ in 0..24 {
        let middle = 0.5 * (low + high);
        if safe(middle) { low = middle } else { high = middle }
    }
    low
}
