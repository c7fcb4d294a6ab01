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
mod scene;
mod style;
#[cfg(test)]
mod testing;

use nalgebra::Vector2;

pub use ball_circle::BallCircle;
pub use ball_run::BallRun;
pub use point_circle::PointCircle;
pub use point_goal::PointGoal;
pub use scene::{Scene, Thing};
pub use style::Style;

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
    fn step(&mut self, action: &[f32]) -> Outcome {
        self.step_late(action, action, 0.0)
    }

    /// As [`Plant::step`], where `held` is held until a share `late` of the
    /// step, 0 to 1, is over, and to the end of the sub-step under way then.
    fn step_late(&mut self, held: &[f32], action: &[f32], late: f64) -> Outcome;

    /// Takes the state that a recorded observation describes, the inverse of
    /// [`Plant::observe`]. Missing entries are 0.
    fn set_observation(&mut self, observation: &[f32]);

    /// The cost that the present state incurs.
    fn cost(&self) -> f64;

    /// What it looks like from above.
    fn scene(&self) -> Scene;

    /// The action of a script that knows the whole state, into `action` `[A]`: a driver for
    /// recordings and for tests, better or worse by its style.
    fn pilot(&self, style: &Style, action: &mut [f32]);
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

/// Of `substeps`, those before an action that comes after a share `late` of them takes effect.
fn substeps_before(late: f64, substeps: usize) -> usize {
    // Rounding must not make an action late that comes with a sub-step's start.
    (late.clamp(0.0, 1.0) * substeps as f64 - 1e-9).ceil() as usize
}

/// The two entries of an action on a plane, clipped.
fn planar(action: &[f32]) -> Vector2<f64> {
    Vector2::new(entry(action, 0), entry(action, 1))
}

/// Writes what a script wants, clipped to -1 and 1, as far as both go.
fn answer(action: &mut [f32], wanted: [f64; 2]) {
    for (action, wanted) in action.iter_mut().zip(wanted) {
        *action = wanted.clamp(-1.0, 1.0) as f32;
    }
}

/// Entry `i` of an action, clipped to -1 and 1; a missing one is 0.
fn entry(action: &[f32], i: usize) -> f64 {
    action.get(i).map_or(0.0, |a| f64::from(a.clamp(-1.0, 1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::TASKS;

    #[test]
    fn an_action_takes_effect_at_the_next_substep() {
        for (late, first) in [(0.0, 0), (1e-12, 0), (0.01, 1), (0.25, 1), (0.26, 2), (0.75, 3), (1.0, 4), (2.0, 4)] {
            assert_eq!(substeps_before(late, 4), first, "{late}");
        }
    }

    #[test]
    fn a_late_step_holds_the_old_action_as_long_as_it_is_late() {
        let (held, action) = ([0.9, -0.4], [-0.7, 0.8]);
        for task in TASKS.iter().filter(|task| task.plant().is_ok()) {
            let after = |step: &dyn Fn(&mut dyn Plant) -> Outcome| {
                let mut plant = task.plant().unwrap();
                plant.reset(3);
                let outcome = step(plant.as_mut());
                let mut state = vec![0.0; task.state];
                plant.observe(&mut state);
                (outcome, state)
            };
            let late = |share| after(&|plant| plant.step_late(&held, &action, share));
            assert_eq!(late(0.0), after(&|plant| plant.step(&action)), "{}", task.name);
            assert_eq!(late(1.0), after(&|plant| plant.step(&held)), "{}", task.name);
            assert!(late(0.5) != late(0.0) && late(0.5) != late(1.0), "{}", task.name);
        }
    }
}
