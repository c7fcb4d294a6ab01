use super::layout::{EXTENT, HAZARD_KEEPOUT, ROBOT_KEEPOUT, VASE_KEEPOUT};
use super::*;
use crate::plant::testing::{observed, scripted};
use crate::recorded::rows;

/// Starts of the simulator, from `tests/data/point_goal_layouts.py`.
#[test]
fn a_start_is_observed_and_pays_as_in_the_simulator() {
    let starts = rows::<f64>(include_str!("../../../tests/data/point_goal_layouts.csv"));
    let mut count = 0;
    for row in starts {
        let place = |i: usize| Vector2::new(row[i], row[i + 1]);
        let layout = Layout {
            robot: place(0),
            heading: row[2],
            goal: place(3),
            hazards: std::array::from_fn(|hazard| place(5 + 2 * hazard)),
            vase: place(21),
        };
        let mut plant = PointGoal::laid_out(layout, Draws::new(0));
        for (entry, (told, expected)) in
            observed::<{ PointGoal::STATE }>(&plant).into_iter().zip(&row[23..83]).enumerate()
        {
            assert!((f64::from(told) - expected).abs() < 1e-6, "entry {entry}: {told}, not {expected}");
        }
        let reward = plant.step(&[1.0, 0.0]).reward;
        assert!((reward - row[83]).abs() < 1e-9, "{reward}, not {}", row[83]);
        count += 1;
    }
    assert_eq!(count, 8);
}

#[test]
fn everything_lies_in_the_square_and_keeps_its_distance() {
    let mut plant = PointGoal::default();
    for seed in 0..200 {
        plant.reset(seed);
        let hazards = plant.hazards.iter().map(|hazard| (*hazard, HAZARD_KEEPOUT));
        let others = [(plant.robot.position, ROBOT_KEEPOUT), (plant.goal, GOAL_KEEPOUT), (plant.vase, VASE_KEEPOUT)];
        let all: Vec<_> = others.into_iter().chain(hazards).collect();
        for (index, (place, keepout)) in all.iter().enumerate() {
            assert!(place.amax() <= EXTENT - keepout);
            for (other, other_keepout) in &all[..index] {
                assert!((place - other).norm() >= keepout + other_keepout);
            }
        }
        let first = plant.clone();
        plant.step(&[1.0, 1.0]);
        plant.reset(seed);
        assert_eq!(plant, first);
    }
}

/// Until a goal is reached, rewards add up to the way that was gained.
#[test]
fn rewards_telescope_to_the_distance_that_was_gained() {
    let mut plant = PointGoal::default();
    plant.reset(5);
    let start = plant.distance();
    let mut rewards = 0.0;
    for tick in 0..40 {
        rewards += plant.step(&[(tick % 3) as f32 - 1.0, 0.3]).reward;
    }
    assert!((rewards - (start - plant.distance())).abs() < 1e-12);
}

#[test]
fn a_goal_that_is_reached_pays_and_moves_where_there_is_room() {
    let mut plant = PointGoal::default();
    plant.reset(1);
    plant.robot = Point::at_rest(plant.goal + Vector2::new(0.25, 0.0), 0.0);
    let before = plant.distance();
    let goal = plant.goal;
    let outcome = plant.step(&[0.0, 0.0]);
    assert!((outcome.reward - (1.0 + before - 0.25)).abs() < 1e-12, "{outcome:?}");
    assert_ne!(plant.goal, goal);
    assert!(Taken::new(plant.robot.position, &plant.hazards, plant.vase).leaves(plant.goal, GOAL_KEEPOUT));
    // The memory of the distance is that of the new goal.
    assert_eq!(plant.step(&[0.0, 0.0]).reward, 0.0);
}

#[test]
fn a_hazard_costs_one_a_step_within_its_radius() {
    let mut plant = PointGoal::default();
    let hazard = plant.hazards[3];
    let mut cost_at = |distance: f64| {
        plant.robot.position = hazard + Vector2::new(0.0, distance);
        plant.hazards = vec![hazard];
        plant.cost()
    };
    assert_eq!([cost_at(0.0), cost_at(0.199), cost_at(0.201)], [1.0, 1.0, 0.0]);
}

#[test]
fn the_vase_is_pushed_out_of_the_way() {
    let mut plant = PointGoal { hazards: Vec::new(), ..PointGoal::default() };
    plant.robot = Point::at_rest(Vector2::zeros(), 0.0);
    plant.vase = Vector2::new(0.3, 0.01);
    for _ in 0..100 {
        plant.step(&[1.0, 0.0]);
    }
    let nose = plant.robot.position + Vector2::new(NOSE_AHEAD, 0.0);
    assert!((plant.vase - nose).norm() >= NOSE_HALF + VASE_HALF - 1e-12);
    assert!((plant.vase - plant.robot.position).norm() >= RADIUS + VASE_HALF - 1e-12);
    assert!(plant.vase.x > 0.5, "{}", plant.vase);
}

#[test]
fn goal_and_vase_are_found_where_they_are_seen() {
    let mut plant = PointGoal::default();
    for seed in 0..50 {
        plant.reset(seed);
        plant.step(&[1.0, -0.4]);
        let told = observed::<{ PointGoal::STATE }>(&plant);
        let mut other = PointGoal::default();
        other.set_observation(&told);
        assert!((other.robot.sees(other.goal) - plant.robot.sees(plant.goal)).norm() < 1e-5);
        assert!((other.robot.sees(other.vase) - plant.robot.sees(plant.vase)).norm() < 1e-5);
    }
}

/// Normalised reward and cost of 20 episodes.
fn fly(margin: f64) -> (f64, f64) {
    scripted("point-goal", Style { pace: 0.9, margin, look: 0.0 })
}

#[test]
fn a_scripted_robot_trades_cost_for_reward() {
    let (careful, careful_cost) = fly(0.3);
    let (bold, bold_cost) = fly(1e-3);
    assert!(careful_cost < bold_cost, "{careful_cost}, {bold_cost}");
    assert!(careful > 0.3 && bold > careful, "{careful}, {bold}");
}
