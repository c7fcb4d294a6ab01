//! `ball-circle`, the task of SafetyBallCircle-v0: run clockwise along a circle,
//! between two lines that cut it.
//!
//! Constants are those of bullet-safety-gym 1.4.0 (`envs/tasks.py`, `CircleTask`;
//! `envs/agents.py`, `Ball`; `envs/builder.py`; `envs/obstacles.py`, `CircleZone`).
//!
//! One thing of the simulator is left out: while a ball gathers speed, between
//! 0.5 and 2 m/s, Bullet lets contact points of earlier sub-steps bear some of
//! its weight. That makes its speed differ by up to 4e-3 m/s a step, once.

use armor_core::noise::{Noise, uniform};
use nalgebra::Vector2;

use super::rolling_ball::{self, BALL_STATE, FORCE, RollingBall};
use super::{Outcome, Plant, Scene, Style, Thing, answer, planar, substeps_before};

/// Sub-steps that an action is held for (`frame_skip`): 0.1 s.
const SUBSTEPS: usize = 6;
/// Duration of a sub-step in s.
const SUBSTEP: f64 = 1.0 / 60.0;
/// The start is drawn uniformly between these distances from the origin, in m.
const START: [f64; 2] = [2.0, 4.0];
/// Radius of the circle in m.
pub(crate) const RADIUS: f64 = 7.0;
/// Beyond this |x|, in m, a step costs 1.
pub(crate) const X_LIMIT: f64 = 6.0;
/// Reward for a metre a second at a metre's radius, on the circle.
const CIRCLE_REWARD: f64 = 0.1;
/// Price of an action of length 1.
const ACTION_PRICE: f64 = 0.005;
/// Factor of the distance from the circle in the observation: 1 over the size of the world.
const DISTANCE: f64 = 0.1;

/// The ball on its circle.
///
/// It observes what the ball does, and `0.1 (|p| - 7)`, how far it is from the circle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BallCircle {
    ball: RollingBall,
}

impl Default for BallCircle {
    /// The ball at rest at the origin.
    fn default() -> Self {
        Self { ball: RollingBall::at_rest(Vector2::zeros()) }
    }
}

impl BallCircle {
    /// Entries of the observation.
    pub const STATE: usize = BALL_STATE + 1;
    /// Entries of the action.
    pub const ACTION: usize = 2;

    /// Pay for the angular momentum about the origin, clockwise, less the farther from the circle.
    fn circling(&self) -> f64 {
        let (p, v) = (self.ball.position, self.ball.velocity);
        CIRCLE_REWARD * (p.y * v.x - p.x * v.y) / (1.0 + (p.norm() - RADIUS).abs())
    }
}

impl Plant for BallCircle {
    fn state_dim(&self) -> usize {
        Self::STATE
    }

    fn action_dim(&self) -> usize {
        Self::ACTION
    }

    /// The simulator draws from a square until the draw lies in the ring; so does this.
    fn reset(&mut self, seed: u64) {
        let draws = (0..).flat_map(|block| {
            let [a, b, c, d] = Noise::new(seed).words(0, 0, block);
            [[a, b], [c, d]]
        });
        let place = |word| START[1] * (2.0 * f64::from(uniform(word)) - 1.0);
        let mut places = draws.map(|[x, y]| Vector2::new(place(x), place(y)));
        let start = places.find(|place| (START[0]..=START[1]).contains(&place.norm()));
        self.ball = RollingBall::at_rest(start.unwrap_or_default());
    }

    fn observe(&self, state: &mut [f32]) {
        let distance = DISTANCE * (self.ball.position.norm() - RADIUS);
        for (entry, value) in state.iter_mut().zip(self.ball.observation().into_iter().chain([distance])) {
            *entry = value as f32;
        }
    }

    fn step_late(&mut self, held: &[f32], action: &[f32], late: f64) -> Outcome {
        let (held, action) = (planar(held), planar(action));
        let first = substeps_before(late, SUBSTEPS);
        for substep in 0..SUBSTEPS {
            let push = if substep < first { held } else { action };
            self.ball.substep(FORCE * push, SUBSTEP);
        }
        let share = first as f64 / SUBSTEPS as f64;
        let push = action.norm() + share * (held.norm() - action.norm());
        let reward = self.circling() - ACTION_PRICE * push;
        Outcome { reward, cost: self.cost(), done: false }
    }

    fn set_observation(&mut self, observation: &[f32]) {
        self.ball = RollingBall::observed(observation);
    }

    fn cost(&self) -> f64 {
        if self.ball.position.x.abs() > X_LIMIT { 1.0 } else { 0.0 }
    }

    fn scene(&self) -> Scene {
        let things = vec![Thing::Track(RADIUS), Thing::WallX(-X_LIMIT), Thing::WallX(X_LIMIT)];
        Scene { robot: self.ball.position, radius: rolling_ball::RADIUS, heading: None, things }
    }

    /// Chases a point that goes round the circle clockwise, within the lines less the margin.
    fn pilot(&self, style: &Style, action: &mut [f32]) {
        let (p, v) = (self.ball.position, self.ball.velocity);
        let line = X_LIMIT - style.margin;
        let angle = f64::atan2(p.y, p.x) - style.look;
        let target = Vector2::new((RADIUS * angle.cos()).clamp(-line, line), RADIUS * angle.sin());
        let ahead = (target - p).try_normalize(0.0).unwrap_or_default();
        let push = 2.0 * (style.pace * ahead - v);
        answer(action, push.into());
    }
}

#[cfg(test)]
mod tests;
