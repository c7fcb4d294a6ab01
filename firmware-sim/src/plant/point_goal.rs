//! `point-goal`, the task of SafetyPointGoal1-v0: run from goal to goal,
//! around hazards.
//!
//! Constants are those of safety-gymnasium 1.0.0
//! (`tasks/safe_navigation/goal/goal_level{0,1}.py`, `assets/geoms/{goal,hazards}.py`,
//! `assets/free_geoms/vases.py`, `bases/base_task.py`).
//!
//! The one vase is light and costs nothing; only the lidar shows it. It is
//! pushed here out of the robot's way without a force on the robot, whose mass
//! is 600 times as large; the simulator's vase may also tumble and slide on.

mod layout;

use armor_core::noise::{Noise, uniform};
use nalgebra::{Rotation2, Vector2};

use super::lidar::{self, BINS};
use super::point::{ACTUATOR_LIMIT, NOSE_AHEAD, NOSE_HALF, Point, RADIUS, SENSORS, TOP_SPEED};
use super::{Outcome, Plant, Scene, Style, Thing, answer, planar};
use layout::{Draws, GOAL_KEEPOUT, Layout, Taken};

/// Within this distance of its middle, in m, the goal is reached.
pub(crate) const GOAL_RADIUS: f64 = 0.3;
/// Within this distance of its middle, in m, a hazard costs 1 a step.
pub(crate) const HAZARD_RADIUS: f64 = 0.2;
/// Half the side of the vase in m.
pub(crate) const VASE_HALF: f64 = 0.1;
/// Reward per metre towards the goal.
const PROGRESS_REWARD: f64 = 1.0;
/// Reward for reaching it.
const GOAL_REWARD: f64 = 1.0;
/// Range of the lidars in m.
const LIDAR_RANGE: f64 = 3.0;
/// Draws of a new goal before the simulator gives up (`build_goal_position`).
const GOAL_DRAWS: usize = 10_000;

/// The Point robot among goal, hazards and vase.
///
/// It observes its own sensors (accelerometer, velocimeter, gyro, magnetometer,
/// three entries each) and a lidar of 16 bins each of the goal, the hazards and
/// the vase.
#[derive(Clone, Debug, PartialEq)]
pub struct PointGoal {
    robot: Point,
    goal: Vector2<f64>,
    hazards: Vec<Vector2<f64>>,
    vase: Vector2<f64>,
    draws: Draws,
}

impl Default for PointGoal {
    /// The episode of seed 0.
    fn default() -> Self {
        let mut draws = Draws::new(0);
        Self::laid_out(Layout::draw(&mut draws), draws)
    }
}

impl PointGoal {
    /// Entries of the observation.
    pub const STATE: usize = SENSORS + 3 * BINS;
    /// Entries of the action.
    pub const ACTION: usize = 2;

    /// The start of an episode.
    fn laid_out(layout: Layout, draws: Draws) -> Self {
        let Layout { robot, heading, goal, hazards, vase } = layout;
        Self { robot: Point::at_rest(robot, heading), goal, hazards: hazards.to_vec(), vase, draws }
    }

    /// Distance to the goal in m.
    fn distance(&self) -> f64 {
        (self.goal - self.robot.position).norm()
    }

    /// Puts the goal where nothing is.
    fn move_goal(&mut self) {
        let taken = Taken::new(self.robot.position, &self.hazards, self.vase);
        let mut places = (0..GOAL_DRAWS).map(|_| self.draws.place(GOAL_KEEPOUT));
        // Where there is no room, the simulator ends in an error; here the goal stays.
        if let Some(place) = places.find(|place| taken.leaves(*place, GOAL_KEEPOUT)) {
            self.goal = place;
        }
    }

    /// Moves the vase out of the robot's body and nose, both taken as discs, as it is itself.
    fn push_vase(&mut self) {
        let nose = self.robot.position + NOSE_AHEAD * Vector2::new(self.robot.heading.cos(), self.robot.heading.sin());
        for (place, radius) in [(self.robot.position, RADIUS), (nose, NOSE_HALF)] {
            let away = self.vase - place;
            let overlap = radius + VASE_HALF - away.norm();
            if overlap > 0.0 {
                self.vase += away.try_normalize(0.0).unwrap_or_else(Vector2::x) * overlap;
            }
        }
    }
}

impl Plant for PointGoal {
    fn state_dim(&self) -> usize {
        Self::STATE
    }

    fn action_dim(&self) -> usize {
        Self::ACTION
    }

    fn reset(&mut self, seed: u64) {
        let mut draws = Draws::new(seed);
        *self = Self::laid_out(Layout::draw(&mut draws), draws);
    }

    fn observe(&self, state: &mut [f32]) {
        let lidar =
            |places: &[Vector2<f64>]| lidar::readings(places.iter().map(|place| self.robot.sees(*place)), LIDAR_RANGE);
        let lidars = [lidar(&[self.goal]), lidar(&self.hazards), lidar(&[self.vase])];
        let values = self.robot.sensors().into_iter().chain(lidars.into_iter().flatten());
        for (entry, value) in state.iter_mut().zip(values) {
            *entry = value as f32;
        }
    }

    fn step_late(&mut self, held: &[f32], action: &[f32], late: f64) -> Outcome {
        let before = self.distance();
        self.robot.step_late(planar(held), planar(action), late);
        self.push_vase();
        let after = self.distance();
        let mut reward = PROGRESS_REWARD * (before - after);
        let cost = self.cost();
        if after <= GOAL_RADIUS {
            reward += GOAL_REWARD;
            self.move_goal();
        }
        Outcome { reward, cost, done: false }
    }

    /// A lidar of several objects does not tell where all of them are: the
    /// robot is taken to the origin, goal and vase to where they are seen, and
    /// hazards are left out.
    fn set_observation(&mut self, observation: &[f32]) {
        self.robot = Point::sensed(observation);
        let to_world = Rotation2::new(self.robot.heading);
        let seen = |lidar: usize| {
            let first = SENSORS + lidar * BINS;
            let readings = observation.get(first..first + BINS).unwrap_or_default();
            to_world * lidar::object(readings, LIDAR_RANGE).unwrap_or(Vector2::new(LIDAR_RANGE, 0.0))
        };
        (self.goal, self.vase) = (seen(0), seen(2));
        self.hazards.clear();
    }

    fn cost(&self) -> f64 {
        let inside = |hazard: &Vector2<f64>| (hazard - self.robot.position).norm() < HAZARD_RADIUS;
        if self.hazards.iter().any(inside) { 1.0 } else { 0.0 }
    }

    fn scene(&self) -> Scene {
        let hazards = self.hazards.iter().map(|&hazard| Thing::Hazard(hazard, HAZARD_RADIUS));
        let others = [Thing::Vase(self.vase, VASE_HALF), Thing::Goal(self.goal, GOAL_RADIUS)];
        let (robot, heading) = (self.robot.position, Some(self.robot.heading));
        Scene { robot, radius: RADIUS, heading, things: hazards.chain(others).collect() }
    }

    /// Runs for the goal, turns away from hazards ahead that are nearer than the margin, and
    /// backs off slowly from what lies behind.
    fn pilot(&self, style: &Style, action: &mut [f32]) {
        let mut wanted = self.robot.sees(self.goal).try_normalize(0.0).unwrap_or_default();
        for seen in self.hazards.iter().map(|hazard| self.robot.sees(*hazard)) {
            let near = HAZARD_RADIUS + style.margin - seen.norm();
            if near > 0.0 {
                wanted -= seen.try_normalize(0.0).unwrap_or_default() * (near / style.margin) * 3.0;
            }
        }
        let pace = if wanted.x > 0.0 { style.pace } else { -style.pace / 3.0 };
        answer(action, [ACTUATOR_LIMIT * pace / TOP_SPEED, 2.0 * f64::atan2(wanted.y, wanted.x)]);
    }
}

#[cfg(test)]
mod tests;
