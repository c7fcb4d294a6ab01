use super::*;
use crate::plant::testing::{observed, scripted};
use crate::recorded::ball_circle_transitions;

/// In Bullet a contact point outlives its contact by some sub-steps. At these
/// sub-steps a slow ball leaves such a point so near to the plane that it takes
/// part of the weight, off centre: up to 4e-3 m/s a step, below 2 m/s only.
#[test]
fn recorded_transitions_are_predicted_to_the_precision_of_the_recording_but_for_stale_contacts() {
    let mut plant = BallCircle::default();
    let (mut slow, mut costs) = (0, 0.0);
    for row in ball_circle_transitions() {
        plant.set_observation(&row.next_observation);
        let expected = plant.ball;
        plant.set_observation(&row.observation);
        let is_slow = plant.ball.velocity.norm() < 2.0;
        let outcome = plant.step(&row.action);
        let (velocity_error, place_error) = if is_slow { (5e-3, 2e-4) } else { (1e-6, 1e-6) };
        assert!((plant.ball.velocity - expected.velocity).norm() < velocity_error, "{row:?}: {plant:?}");
        assert!((plant.ball.position - expected.position).norm() < place_error, "{row:?}: {plant:?}");
        assert!((outcome.reward - f64::from(row.reward)).abs() < velocity_error, "{row:?}: {outcome:?}");
        assert_eq!(outcome.cost, f64::from(row.cost), "{row:?}");
        slow += u32::from(is_slow);
        costs += outcome.cost;
    }
    assert!(slow <= 3 && costs >= 5.0);
}

/// Position and velocity of a ball.
fn at(position: [f64; 2], velocity: [f64; 2]) -> BallCircle {
    let mut plant = BallCircle::default();
    plant.ball.position = position.into();
    plant.ball.velocity = velocity.into();
    plant
}

#[test]
fn a_start_lies_in_its_ring_and_is_decided_by_the_seed() {
    let mut plant = BallCircle::default();
    let (mut nearest, mut farthest) = (f64::INFINITY, 0.0_f64);
    for seed in 0..1000 {
        plant.reset(seed);
        let distance = plant.ball.position.norm();
        (nearest, farthest) = (nearest.min(distance), farthest.max(distance));
        let first = plant;
        plant.step(&[1.0, 1.0]);
        plant.reset(seed);
        assert_eq!(plant, first);
    }
    assert!((2.0..2.05).contains(&nearest) && (3.95..=4.0).contains(&farthest), "{nearest} to {farthest}");
}

/// 0.1 m/s times metres on the circle, clockwise; half of it a metre off.
#[test]
fn the_pay_is_the_angular_momentum_less_the_farther_from_the_circle() {
    assert!((at([0.0, 7.0], [2.0, 5.0]).circling() - 1.4).abs() < 1e-12);
    assert!((at([7.0, 0.0], [0.0, 2.0]).circling() + 1.4).abs() < 1e-12);
    assert!((at([0.0, 8.0], [1.0, 0.0]).circling() - 0.4).abs() < 1e-12);
    assert_eq!(at([0.0, 7.0], [0.0, 3.0]).circling(), 0.0);
}

#[test]
fn an_idle_ball_at_rest_stays_and_an_action_has_its_price() {
    let mut plant = at([3.0, 0.0], [0.0, 0.0]);
    let before = plant;
    assert_eq!(plant.step(&[0.0, 0.0]), Outcome { reward: 0.0, cost: 0.0, done: false });
    assert_eq!(plant, before);
    let mut pushed = before;
    let reward = pushed.step(&[0.6, 0.8]).reward;
    assert!((reward - (pushed.circling() - 0.005)).abs() < 1e-9, "{reward}");
}

#[test]
fn a_step_costs_beyond_the_lines_and_not_at_them() {
    let cost = |x: f64| at([x, 0.0], [0.0, 0.0]).cost();
    assert_eq!([cost(6.0), cost(-6.0), cost(6.0f64.next_up()), cost(-7.0)], [0.0, 0.0, 1.0, 1.0]);
}

#[test]
fn an_observation_is_taken_and_told_again() {
    let mut plant = BallCircle::default();
    plant.reset(3);
    for _ in 0..20 {
        plant.step(&[0.4, -0.9]);
    }
    let told = observed::<{ BallCircle::STATE }>(&plant);
    let mut other = BallCircle::default();
    other.set_observation(&told);
    for (again, told) in observed::<{ BallCircle::STATE }>(&other).into_iter().zip(told) {
        assert!((again - told).abs() <= 1e-6);
    }
    assert!((f64::from(told[7]) - 0.1 * (plant.ball.position.norm() - 7.0)).abs() < 1e-7);
}

/// Normalised reward and cost of 20 episodes.
fn fly(margin: f64) -> (f64, f64) {
    scripted("ball-circle", Style { pace: 6.0, margin, look: 0.3 })
}

#[test]
fn a_scripted_ball_trades_cost_for_reward() {
    let (safe, safe_cost) = fly(1.0);
    let (bold, bold_cost) = fly(-2.0);
    assert!(safe_cost == 0.0 && safe > 0.4, "{safe} at {safe_cost}");
    assert!(bold_cost > 20.0 && bold > safe && bold < 1.0, "{bold} at {bold_cost}");
}
