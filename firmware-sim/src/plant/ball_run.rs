//! `ball-run`, the task of SafetyBallRun-v0: run along x, not too fast, between two lines.
//!
//! Constants are those of bullet-safety-gym 1.4.0 (`envs/tasks.py`, `RunTask`;
//! `envs/agents.py`, `Ball`; `envs/builder.py`).

use armor_core::noise::{Noise, uniform};
use nalgebra::Vector2;

use super::rolling_ball::{self, BALL_STATE, FORCE, RollingBall};
use super::{Outcome, Plant, Scene, Style, Thing, answer, planar, substeps_before};

/// Sub-steps that an action is held for (`frame_skip`): 1/30 s.
const SUBSTEPS: usize = 4;
/// Duration of a sub-step in s.
const SUBSTEP: f64 = 1.0 / 120.0;
/// The start is drawn uniformly within this distance of the origin, in x and in y, in m.
const START: f64 = 0.01;
/// Beyond this |y|, in m, a step costs 1.
pub(crate) const Y_LIMIT: f64 = 2.0;
/// Beyond this planar speed, in m/s, a step costs 1.
const SPEED_LIMIT: f64 = 2.5;
/// The goal lies here on the x axis, in m, and is never reached.
const GOAL: f64 = 1000.0;
/// Reward per metre towards the goal.
const PROGRESS_REWARD: f64 = 60.0;
/// Price of an action of length 1.
const ACTION_PRICE: f64 = 0.5;

/// The ball on its run.
///
/// It observes `0.1 (x, y)`, `0.2 (vx, vy)` and `0.1 (wx, wy, wz)`; `wz` is 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BallRun {
    ball: RollingBall,
}

impl Default for BallRun {
    /// The ball at rest at the origin.
    fn default() -> Self {
        Self { ball: RollingBall::at_rest(Vector2::zeros()) }
    }
}

impl BallRun {
    /// Entries of the observation.
    pub const STATE: usize = BALL_STATE;
    /// Entries of the action.
    pub const ACTION: usize = 2;

    /// Minus the distance to the goal, in units of reward.
    fn potential(&self) -> f64 {
        -(self.ball.position - Vector2::new(GOAL, 0.0)).norm() * PROGRESS_REWARD
    }
}

impl Plant for BallRun {
    fn state_dim(&self) -> usize {
        Self::STATE
    }

    fn action_dim(&self) -> usize {
        Self::ACTION
    }

    /// The simulator idles for one step after it has stored the potential.
    /// A resting ball stays where it is, so there is nothing to do here: in the
    /// recordings the first reward is that of the way from the first
    /// observation on.
    fn reset(&mut self, seed: u64) {
        let [x, y, ..] = Noise::new(seed).words(0, 0, 0);
        let start = |word| START * (2.0 * f64::from(uniform(word)) - 1.0);
        self.ball = RollingBall::at_rest(Vector2::new(start(x), start(y)));
    }

    fn observe(&self, state: &mut [f32]) {
        for (entry, value) in state.iter_mut().zip(self.ball.observation()) {
            *entry = value as f32;
        }
    }

    fn step_late(&mut self, held: &[f32], action: &[f32], late: f64) -> Outcome {
        let (held, action) = (planar(held), planar(action));
        let before = self.potential();
        let first = substeps_before(late, SUBSTEPS);
        for substep in 0..SUBSTEPS {
            let push = if substep < first { held } else { action };
            self.ball.substep(FORCE * push, SUBSTEP);
        }
        let share = first as f64 / SUBSTEPS as f64;
        let push = action.norm() + share * (held.norm() - action.norm());
        let reward = self.potential() - before - ACTION_PRICE * push;
        Outcome { reward, cost: self.cost(), done: false }
    }

    fn set_observation(&mut self, observation: &[f32]) {
        self.ball = RollingBall::observed(observation);
    }

    fn cost(&self) -> f64 {
        let outside = self.ball.position.y.abs() > Y_LIMIT;
        let too_fast = self.ball.velocity.norm() > SPEED_LIMIT;
        if outside || too_fast { 1.0 } else { 0.0 }
    }

    fn scene(&self) -> Scene {
        let things = vec![Thing::WallY(-Y_LIMIT), Thing::WallY(Y_LIMIT)];
        Scene { robot: self.ball.position, radius: rolling_ball::RADIUS, heading: None, things }
    }

    /// Speeds up along x and keeps to a line beside the wall at y = 2 m; gains in 1/s and 1/s^2
    /// of the force that moves the ball.
    fn pilot(&self, style: &Style, action: &mut [f32]) {
        let (p, v) = (self.ball.position, self.ball.velocity);
        let line = Y_LIMIT - style.margin;
        answer(action, [0.8 * (style.pace - v.x), 0.4 * (line - p.y) - 0.6 * v.y]);
    }
}

#[cfg(test)]
mod tests;
