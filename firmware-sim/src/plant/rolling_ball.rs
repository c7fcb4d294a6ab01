//! The ball of Bullet-Safety-Gym: a solid sphere on a plane, pushed by a
//! horizontal force at its centre.
//!
//! This is Bullet's multi-body solver for one sphere in one contact with a
//! level plane, reduced by hand: the ball neither jumps nor turns about the
//! vertical, so position, velocity and spin are planar, and the normal impulse
//! of a sub-step is the weight's. Within a sub-step Bullet
//!
//! 1. adds the acceleration of force and damping to the velocities,
//! 2. solves the contact by sequential impulses, rolling friction before
//!    sliding friction, each limited to a disc, and gives up early where an
//!    iteration changes little,
//! 3. moves the ball with the velocities so found.
//!
//! What step 2 leaves unsolved near a standstill is part of the recorded
//! motion and is reproduced here: side by side with the simulator, under
//! recorded actions, the ball is 1e-12 m off after an episode.
//!
//! The source is that of pybullet 3.2.7:
//! `btMultiBody.cpp`, `btMultiBodyConstraintSolver.cpp`,
//! `btSequentialImpulseConstraintSolver.cpp` and
//! `PhysicsServerCommandProcessor.cpp`; constants name their own file below.

use nalgebra::Vector2;

/// Radius in m (`ball.urdf` of bullet-safety-gym 1.4.0, as are mass and friction of the ball).
pub(super) const RADIUS: f64 = 0.5;
/// Mass in kg.
pub(super) const MASS: f64 = 0.3;
/// Moment of inertia in kg m^2: the solid sphere's, for `bases.py` loads the
/// URDF without the flag that takes the inertia from it.
const INERTIA: f64 = 0.4 * MASS * RADIUS * RADIUS;
/// What an impulse at the contact has to move, in kg: `1 / (1/m + r^2/I)`.
const CONTACT_MASS: f64 = 1.0 / (1.0 / MASS + RADIUS * RADIUS / INERTIA);
/// Weight in N (gravity 9.81 in `builder.py`).
const WEIGHT: f64 = MASS * 9.81;
/// Sliding friction: the ball's 1.10 times the plane's 0.8 (`worlds.py`).
const FRICTION: f64 = 1.10 * 0.8;
/// Rolling friction in m: the ball's 0.03 times the plane's sliding 0.8; the
/// plane's own is 0 (`btManifoldResult.cpp`, `calculateCombinedRollingFriction`).
const ROLLING_FRICTION: f64 = 0.03 * 0.8;
/// Damping in 1/s, linear and angular; `btMultiBody.cpp` sets it in single precision.
const DAMPING: f64 = 0.04_f32 as f64;
/// Iterations of the solver (`builder.py`).
const ITERATIONS: usize = 5;
/// The solver stops where an iteration's squared change of velocity is no
/// larger (`PhysicsServerCommandProcessor.cpp`).
const RESIDUAL: f64 = 1e-7;

/// Force of a full action in N (`agents.py`, `Ball`).
pub(super) const FORCE: f64 = 3.5;
/// Entries of what a ball observes.
pub(super) const BALL_STATE: usize = 7;
/// Factor of the position in the observation (`agents.py`, `Ball`, as are the next two).
const POSITION_FACTOR: f64 = 0.1;
/// Factor of the velocity in the observation.
const VELOCITY_FACTOR: f64 = 0.2;
/// Factor of the spin in the observation.
const SPIN_FACTOR: f64 = 0.1;

/// A ball on a level plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RollingBall {
    /// Centre in m.
    pub(super) position: Vector2<f64>,
    /// Velocity of the centre in m/s.
    pub(super) velocity: Vector2<f64>,
    /// Angular velocity about x and y in rad/s.
    pub(super) spin: Vector2<f64>,
}

impl RollingBall {
    /// A ball at rest.
    pub(super) fn at_rest(position: Vector2<f64>) -> Self {
        Self { position, velocity: Vector2::zeros(), spin: Vector2::zeros() }
    }

    /// The ball of a recorded observation, the inverse of [`RollingBall::observation`]; missing entries are 0.
    pub(super) fn observed(observation: &[f32]) -> Self {
        let entry = |i: usize| observation.get(i).copied().map_or(0.0, f64::from);
        Self {
            position: Vector2::new(entry(0), entry(1)) / POSITION_FACTOR,
            velocity: Vector2::new(entry(2), entry(3)) / VELOCITY_FACTOR,
            spin: Vector2::new(entry(4), entry(5)) / SPIN_FACTOR,
        }
    }

    /// `0.1 (x, y)`, `0.2 (vx, vy)` and `0.1 (wx, wy, wz)`; `wz` is 0.
    pub(super) fn observation(&self) -> [f64; BALL_STATE] {
        let (p, v, w) = (POSITION_FACTOR * self.position, VELOCITY_FACTOR * self.velocity, SPIN_FACTOR * self.spin);
        [p.x, p.y, v.x, v.y, w.x, w.y, 0.0]
    }

    /// Advances by a sub-step of `duration`, in s, under a force in N.
    pub(super) fn substep(&mut self, force: Vector2<f64>, duration: f64) {
        // Bullet damps with a linear and a quadratic term of the same size.
        let damping = |velocity: &Vector2<f64>| velocity * (DAMPING * (1.0 + velocity.norm()));
        self.velocity += duration * (force / MASS - damping(&self.velocity));
        self.spin -= duration * damping(&self.spin);

        let mut rolling = Vector2::zeros();
        let mut sliding = Vector2::zeros();
        for iteration in 0..ITERATIONS {
            let spun = self.resist_rolling(&mut rolling, duration);
            let slipped = self.resist_sliding(&mut sliding, duration);
            // Bullet sums the two rows of a friction before it squares. The
            // first iteration also carries the weight and never ends the loop.
            let residual = spun.sum().powi(2).max(slipped.sum().powi(2));
            if iteration > 0 && residual <= RESIDUAL {
                break;
            }
        }
        self.position += duration * self.velocity;
    }

    /// Turns against the spin, `impulse` in all at most; returns the change of spin.
    fn resist_rolling(&mut self, impulse: &mut Vector2<f64>, duration: f64) -> Vector2<f64> {
        let total = limited(*impulse - INERTIA * self.spin, ROLLING_FRICTION * WEIGHT * duration);
        let change = (total - *impulse) / INERTIA;
        *impulse = total;
        self.spin += change;
        change
    }

    /// Pushes the contact point against its slip; returns the change of slip.
    fn resist_sliding(&mut self, impulse: &mut Vector2<f64>, duration: f64) -> Vector2<f64> {
        let total = limited(*impulse - CONTACT_MASS * self.slip(), FRICTION * WEIGHT * duration);
        let change = total - *impulse;
        *impulse = total;
        self.velocity += change / MASS;
        self.spin += Vector2::new(change.y, -change.x) * (RADIUS / INERTIA);
        change / CONTACT_MASS
    }

    /// Velocity of the lowest point of the ball; zero while it rolls.
    fn slip(&self) -> Vector2<f64> {
        self.velocity + RADIUS * Vector2::new(-self.spin.y, self.spin.x)
    }
}

/// `impulse`, shortened to `limit` where it is longer.
fn limited(impulse: Vector2<f64>, limit: f64) -> Vector2<f64> {
    let length = impulse.norm();
    if length > limit { impulse * (limit / length) } else { impulse }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of the run task, in s.
    const SUBSTEP: f64 = 1.0 / 120.0;

    fn rolling(vx: f64, vy: f64) -> RollingBall {
        RollingBall {
            position: Vector2::new(0.3, -0.2),
            velocity: Vector2::new(vx, vy),
            spin: Vector2::new(-vy, vx) / RADIUS,
        }
    }

    #[track_caller]
    fn close(actual: f64, expected: f64, tolerance: f64) {
        assert!((actual - expected).abs() <= tolerance, "{actual} is not {expected}");
    }

    #[test]
    fn a_resting_ball_stays() {
        let mut ball = RollingBall::at_rest(Vector2::new(0.3, -0.2));
        let before = ball;
        ball.substep(Vector2::zeros(), SUBSTEP);
        assert_eq!(ball, before);
    }

    /// Friction at the contact has no moment about it, so the angular momentum
    /// about the contact changes by force, rolling friction and damping alone.
    #[test]
    fn a_rolling_ball_follows_its_angular_momentum_about_the_contact() {
        for (speed, push) in [(0.5, 0.0), (2.5, 3.5), (2.5, -3.5), (9.0, 3.5)] {
            let mut ball = rolling(speed, 0.0);
            ball.substep(Vector2::new(push, 0.0), SUBSTEP);
            let h = SUBSTEP;
            let damped = |v: f64| v - h * 0.04 * v * (1.0 + v);
            let momentum = MASS * RADIUS * (damped(speed) + h * push / MASS) + INERTIA * damped(speed / RADIUS)
                - h * 0.03 * 0.8 * MASS * 9.81;
            close(ball.velocity.x, momentum / (MASS * RADIUS + INERTIA / RADIUS), 1e-9);
            close(ball.slip().norm(), 0.0, 1e-12);
            close(ball.position.x, 0.3 + h * ball.velocity.x, 1e-15);
        }
    }

    #[test]
    fn a_sliding_ball_is_slowed_by_the_full_friction() {
        let mut ball = RollingBall { spin: Vector2::zeros(), ..rolling(3.0, 0.0) };
        ball.substep(Vector2::zeros(), SUBSTEP);
        let expected = 3.0 - SUBSTEP * (0.04 * 3.0 * (1.0 + 3.0) + 0.88 * 9.81);
        close(ball.velocity.x, expected, 1e-9);
    }

    /// Below the limit of rolling friction an iteration stops the spin, and the
    /// sliding friction after it leaves `1 / (1 + 2/5)` of the speed.
    #[test]
    fn a_nearly_resting_ball_keeps_five_sevenths_of_its_speed_an_iteration() {
        for (speed, iterations) in [(2e-3, 5), (1e-4, 2)] {
            let mut ball = rolling(speed, 0.0);
            ball.substep(Vector2::zeros(), SUBSTEP);
            let damped = speed - SUBSTEP * 0.04 * speed * (1.0 + speed);
            close(ball.velocity.x / damped, (5.0f64 / 7.0).powi(iterations), 1e-5);
        }
    }

    #[test]
    fn the_largest_push_makes_no_ball_slip() {
        for speed in [0.0, 2.5, 12.0] {
            let mut ball = rolling(speed, -speed);
            for _ in 0..40 {
                ball.substep(Vector2::new(3.5, 3.5), SUBSTEP);
                close(ball.slip().norm(), 0.0, 1e-12);
            }
        }
    }

    #[test]
    fn the_ball_knows_no_left_or_right() {
        let mut ball = rolling(0.4, 0.1);
        let mut mirrored = rolling(0.4, -0.1);
        for _ in 0..100 {
            ball.substep(Vector2::new(0.5, -0.7), SUBSTEP);
            mirrored.substep(Vector2::new(0.5, 0.7), SUBSTEP);
            // What the solver leaves unsolved depends on the axes: its residual is the sum of two rows.
            close(ball.velocity.x, mirrored.velocity.x, 1e-4);
            close(ball.velocity.y, -mirrored.velocity.y, 1e-4);
        }
    }
}
