//! Plants: the robots and tasks that a controller can fly without a simulator.
//!
//! A plant advances in its own control steps, in f64, and repeats itself bit
//! for bit from a seed. [`crate::calibrate`] says how far it is from a
//! recording of the simulator that it stands for.

mod ball_circle;
mod ball_run;
mod lidar;
mod point;
mod point_circle;
mod point_goal;
mod rolling_ball;

pub use ball_circle::BallCircle;
pub use ball_run::BallRun;
pub use point_circle::PointCircle;
pub use point_goal::PointGoal;

/// A robot and its task.
pub trait Plant {
    /// Entries of the state that the controller senses.
    fn state_dim(&self) -> usize;

    /// Entries of the action that the controller answers.
    fn action_dim(&self) -> usize;

    /// Starts an episode; the seed decides where.
    fn reset(&mut self, seed: u64);

    /// Writes what the sensors say into `state`, entry by entry as far as both go.
    fn observe(&self, state: &mut [f32]);

    /// Holds `action` for one control step. Entries beyond -1 and 1 are
    /// clipped, missing ones are 0.
    fn step(&mut self, action: &[f32]) -> Outcome;

    /// Takes the state that a recorded observation describes, the inverse of
    /// [`Plant::observe`]. Missing entries are 0.
    fn set_observation(&mut self, observation: &[f32]);

    /// The cost that the present state incurs.
    fn cost(&self) -> f64;
}

/// What a control step brought.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Reward of the step, as the task pays it.
    pub reward: f64,
    /// Cost that the step incurred.
    pub cost: f64,
    /// Whether the episode ended before its horizon.
    pub done: bool,
}

/// Entry `i` of an action, clipped to -1 and 1; a missing one is 0.
fn entry(action: &[f32], i: usize) -> f64 {
    action.get(i).map_or(0.0, |a| f64::from(a.clamp(-1.0, 1.0)))
}
