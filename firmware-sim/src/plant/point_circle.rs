//! `point-circle`, the task of SafetyPointCircle1-v0: run counter-clockwise
//! along a circle, between two walls that cut it.
//!
//! Constants are those of safety-gymnasium 1.0.0
//! (`tasks/safe_navigation/circle/circle_level{0,1}.py`, `assets/geoms/{circle,sigwalls}.py`).

use std::f64::consts::TAU;

use armor_core::noise::{Noise, uniform};
use nalgebra::{Rotation2, Vector2};

use super::lidar::{self, BINS};
use super::point::{self, ACTUATOR_LIMIT, FULL_THRUST, Point, SENSORS, SLIDE_RATE};
use super::{Outcome, Plant, Scene, Style, Thing, answer, planar};

/// The start is drawn uniformly within this distance of the origin, in x and in y, in m.
const START: f64 = 0.8;
/// Radius of the circle in m.
pub(crate) const RADIUS: f64 = 1.5;
/// Beyond this |x|, in m, a step costs 1.
pub(crate) const X_LIMIT: f64 = 1.125;
/// Reward for a metre a second along the circle.
const CIRCLE_REWARD: f64 = 0.1;
/// Range of the lidar in m.
const LIDAR_RANGE: f64 = 6.0;

/// The Point robot on its circle.
///
/// It observes its own sensors (accelerometer, velocimeter, gyro, magnetometer,
/// three entries each) and a lidar of 16 bins of the circle's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointCircle {
    robot: Point,
}

impl Default for PointCircle {
    /// The robot at rest at the origin.
    fn default() -> Self {
        Self { robot: Point::at_rest(Vector2::zeros(), 0.0) }
    }
}

impl PointCircle {
    /// Entries of the observation.
    pub const STATE: usize = SENSORS + BINS;
    /// Entries of the action.
    pub const ACTION: usize = 2;

    /// Pay for the speed around the origin, counter-clockwise, less the farther from the circle.
    fn circling(&self) -> f64 {
        let (p, v) = (self.robot.position, self.robot.velocity);
        let radius = p.norm();
        // The simulator divides by 0 at the origin, where no speed leads around it.
        let around = if radius > 0.0 { (p.x * v.y - p.y * v.x) / radius } else { 0.0 };
        CIRCLE_REWARD * around / (1.0 + (radius - RADIUS).abs())
    }
}

impl Plant for PointCircle {
    fn state_dim(&self) -> usize {
        Self::STATE
    }

    fn action_dim(&self) -> usize {
        Self::ACTION
    }

    fn reset(&mut self, seed: u64) {
        let [x, y, heading, _] = Noise::new(seed).words(0, 0, 0).map(|word| f64::from(uniform(word)));
        let start = |draw| START * (2.0 * draw - 1.0);
        self.robot = Point::at_rest(Vector2::new(start(x), start(y)), TAU * heading);
    }

    fn observe(&self, state: &mut [f32]) {
        let lidar = lidar::readings([self.robot.sees(Vector2::zeros())], LIDAR_RANGE);
        for (entry, value) in state.iter_mut().zip(self.robot.sensors().into_iter().chain(lidar)) {
            *entry = value as f32;
        }
    }

    fn step_late(&mut self, held: &[f32], action: &[f32], late: f64) -> Outcome {
        self.robot.step_late(planar(held), planar(action), late);
        Outcome { reward: self.circling(), cost: self.cost(), done: false }
    }

    fn set_observation(&mut self, observation: &[f32]) {
        self.robot = Point::sensed(observation);
        let lidar = observation.get(SENSORS..Self::STATE).unwrap_or_default();
        let centre = lidar::object(lidar, LIDAR_RANGE).unwrap_or_default();
        // Seen from the origin, the robot is where the origin is not.
        self.robot.position = -(Rotation2::new(self.robot.heading) * centre);
    }

    fn cost(&self) -> f64 {
        if self.robot.position.x.abs() > X_LIMIT { 1.0 } else { 0.0 }
    }

    fn scene(&self) -> Scene {
        let things = vec![Thing::Track(RADIUS), Thing::WallX(-X_LIMIT), Thing::WallX(X_LIMIT)];
        Scene { robot: self.robot.position, radius: point::RADIUS, heading: Some(self.robot.heading), things }
    }

    /// Runs after a place ahead on a track within the walls: the circle, where that lies within
    /// the walls less the margin, and along them elsewhere, its corners rounded. Turns to where
    /// the thrust is needed that holds the speed against damping.
    fn pilot(&self, style: &Style, action: &mut [f32]) {
        let (p, v) = (self.robot.position, self.robot.velocity);
        let wall = X_LIMIT - style.margin;
        let (sin, cos) = (f64::atan2(p.y, p.x) + style.look).sin_cos();
        let distance = (RADIUS.powi(-8) + (cos.abs() / wall).powi(8)).powf(-0.125);
        let ahead = distance * Vector2::new(cos, sin) - p;
        let thrust = SLIDE_RATE * v + 6.0 * (style.pace * ahead.try_normalize(0.0).unwrap_or_default() - v);
        let seen = self.robot.sees(p + thrust);
        answer(action, [ACTUATOR_LIMIT * seen.x / FULL_THRUST, 3.0 * f64::atan2(seen.y, seen.x)]);
    }
}

#[cfg(test)]
mod tests;
