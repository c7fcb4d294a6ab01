//! The Point robot of Safety-Gymnasium: a sphere on a plane that thrusts along
//! its nose and turns.
//!
//! This is MuJoCo's forward dynamics of `point.xml` (safety-gymnasium 1.0.0,
//! `assets/xmls/point.xml`), reduced by hand: two slides and a hinge, no
//! contact carries force. With the centre of mass `l` ahead of the axis,
//!
//! ```text
//! m x'' - m l (th'' sin th + th'^2 cos th) = F cos th - b x'
//! m y'' + m l (th'' cos th - th'^2 sin th) = F sin th - b y'
//! I th'' + m l (y'' cos th - x'' sin th)   = M - c th'
//! ```
//!
//! A sub-step is MuJoCo's semi-implicit Euler, with the damping of the joints
//! at its end (`engine_forward.c`, `mj_Euler`). The turning servo is far
//! stiffer than the sub-step: where it does not saturate, an error grows
//! fivefold a sub-step, in the simulator as here. So the two agree to
//! rounding for a step or two, and then in everything but the servo's chatter.

use std::f64::consts::TAU;

use nalgebra::{Rotation2, Vector2};

use super::substeps_before;

/// Duration of a sub-step in s.
const SUBSTEP: f64 = 0.002;
/// Sub-steps that an action is held for (`sim_conf.frameskip_binom_n`).
const SUBSTEPS: usize = 10;
/// Radius of the body in m.
pub(crate) const RADIUS: f64 = 0.1;
/// Mass of the body in kg: a sphere of density 1.
const BODY_MASS: f64 = 2.0 / 3.0 * TAU * RADIUS * RADIUS * RADIUS;
/// Distance of the nose, a cube, from the axis in m.
pub(crate) const NOSE_AHEAD: f64 = 0.1;
/// Half the side of the nose in m.
pub(crate) const NOSE_HALF: f64 = 0.05;
/// Mass of the nose in kg: a cube of density 1.
const NOSE_MASS: f64 = 8.0 * NOSE_HALF * NOSE_HALF * NOSE_HALF;
/// Mass in kg.
const MASS: f64 = BODY_MASS + NOSE_MASS;
/// First moment of mass about the axis in kg m, `m l`.
const MOMENT: f64 = NOSE_MASS * NOSE_AHEAD;
/// Moment of inertia about the axis in kg m^2.
const INERTIA: f64 =
    0.4 * BODY_MASS * RADIUS * RADIUS + NOSE_MASS * (2.0 / 3.0 * NOSE_HALF * NOSE_HALF + NOSE_AHEAD * NOSE_AHEAD);
/// Damping of the slides in N s/m.
const SLIDE_DAMPING: f64 = 0.01;
/// Damping of the hinge in N m s.
const HINGE_DAMPING: f64 = 0.005;
/// Force, in N, and torque, in N m, of one unit of an actuator.
const GEAR: f64 = 0.3;
/// An actuator gives no more units than this.
pub(super) const ACTUATOR_LIMIT: f64 = 0.05;
/// Acceleration under the largest thrust in m/s^2.
pub(super) const FULL_THRUST: f64 = GEAR * ACTUATOR_LIMIT / MASS;
/// Rate at which the slides' damping brakes, in 1/s.
pub(super) const SLIDE_RATE: f64 = SLIDE_DAMPING / MASS;
/// Speed that the largest thrust reaches in m/s.
pub(super) const TOP_SPEED: f64 = GEAR * ACTUATOR_LIMIT / SLIDE_DAMPING;
/// What the accelerometer reads of gravity, in m/s^2.
const GRAVITY: f64 = 9.81;
/// Strength of the magnetic field along -y.
const FIELD: f64 = 0.5;
/// Entries that the robot's own sensors read.
pub(super) const SENSORS: usize = 12;

/// The robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point {
    /// Place of the axis in m.
    pub(super) position: Vector2<f64>,
    /// Its velocity in m/s.
    pub(super) velocity: Vector2<f64>,
    /// Heading in rad, counter-clockwise from x.
    pub(super) heading: f64,
    /// Its change in rad/s.
    pub(super) spin: f64,
    /// Acceleration of the axis in m/s^2, under the action that is held.
    acceleration: Vector2<f64>,
}

impl Point {
    /// A robot at rest.
    pub(super) fn at_rest(position: Vector2<f64>, heading: f64) -> Self {
        let zero = Vector2::zeros();
        Self { position, velocity: zero, heading, spin: 0.0, acceleration: zero }
    }

    /// The robot of recorded sensors, the inverse of [`Point::sensors`], at a
    /// place that they do not tell. Missing entries are 0.
    pub(super) fn sensed(sensors: &[f32]) -> Self {
        let entry = |i: usize| sensors.get(i).copied().map_or(0.0, f64::from);
        let heading = f64::atan2(-entry(9), -entry(10));
        let to_world = Rotation2::new(heading);
        Self {
            position: Vector2::zeros(),
            velocity: to_world * Vector2::new(entry(3), entry(4)),
            heading,
            spin: entry(8),
            acceleration: to_world * Vector2::new(entry(0), entry(1)),
        }
    }

    /// Accelerometer, velocimeter, gyro and magnetometer, each in three
    /// dimensions along the nose, to its left and upwards.
    pub(super) fn sensors(&self) -> [f64; SENSORS] {
        let to_body = Rotation2::new(-self.heading);
        let (a, v) = (to_body * self.acceleration, to_body * self.velocity);
        let (sin, cos) = self.heading.sin_cos();
        [a.x, a.y, GRAVITY, v.x, v.y, 0.0, 0.0, 0.0, self.spin, -FIELD * sin, -FIELD * cos, 0.0]
    }

    /// A place in the world as the robot sees it: ahead, and to the left.
    pub(super) fn sees(&self, place: Vector2<f64>) -> Vector2<f64> {
        Rotation2::new(-self.heading) * (place - self.position)
    }

    /// Holds actions, thrust and turn, each within -1 and 1, for a control
    /// step: `held` for the share `late` of it, then `action`.
    pub(super) fn step_late(&mut self, held: Vector2<f64>, action: Vector2<f64>, late: f64) {
        let first = substeps_before(late, SUBSTEPS);
        let action_at = |substep| if substep < first { held } else { action };
        for substep in 0..SUBSTEPS {
            let action = action_at(substep);
            // Damping at the end of the sub-step: as if the masses were larger.
            let (acceleration, turn) = self.accelerations(action, SUBSTEP);
            self.velocity += SUBSTEP * acceleration;
            self.spin += SUBSTEP * turn;
            self.position += SUBSTEP * self.velocity;
            self.heading += SUBSTEP * self.spin;
        }
        (self.acceleration, _) = self.accelerations(action_at(SUBSTEPS - 1), 0.0);
    }

    /// Solves the equations of motion for the accelerations of slides and
    /// hinge, with the damping of a time `ahead`, in s.
    fn accelerations(&self, action: Vector2<f64>, ahead: f64) -> (Vector2<f64>, f64) {
        let limited = |units: f64| GEAR * units.clamp(-ACTUATOR_LIMIT, ACTUATOR_LIMIT);
        let thrust = limited(action.x);
        // A velocity servo on the geared hinge.
        let torque = limited(action.y - GEAR * self.spin);

        let (sin, cos) = self.heading.sin_cos();
        let (nose, left) = (Vector2::new(cos, sin), Vector2::new(-sin, cos));
        let force = (thrust + MOMENT * self.spin * self.spin) * nose - SLIDE_DAMPING * self.velocity;
        let mass = MASS + ahead * SLIDE_DAMPING;
        let inertia = INERTIA + ahead * HINGE_DAMPING - MOMENT * MOMENT / mass;
        let turn = (torque - HINGE_DAMPING * self.spin - MOMENT / mass * force.dot(&left)) / inertia;
        ((force - MOMENT * turn * left) / mass, turn)
    }
}

#[cfg(test)]
mod tests;
