//! How far a plant is from a recording of its simulator.
//!
//! A recorded row is judged twice. *One step*: the plant takes the recorded
//! observation's state, does the recorded action, and is compared with what
//! came next. *Replay*: the plant takes the first observation of an episode
//! and does all its recorded actions on its own. A recording is in single
//! precision, so neither can be nearer than its rounding; the replay suffers
//! from it once an episode, the single step once a step.

use std::fmt;

use serde::Serialize;
use thiserror::Error;

use crate::plant::Plant;
use crate::task::{Task, TaskError};

/// A recorded control step.
#[derive(Clone, Copy, Debug)]
pub struct Transition<'a> {
    /// Whether it opens an episode.
    pub first: bool,
    /// What the sensors said before `[S]`.
    pub observation: &'a [f32],
    /// What was done `[A]`.
    pub action: &'a [f32],
    /// Reward of the step.
    pub reward: f32,
    /// Cost of the step.
    pub cost: f32,
    /// What the sensors said after `[S]`.
    pub next_observation: &'a [f32],
}

/// A recorded row has not the sizes of the task.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error(
    "the recording has {state} state and {action} action entries, {task} has {expected_state} and {expected_action}; name the task that was recorded"
)]
pub struct SizeError {
    task: &'static str,
    state: usize,
    action: usize,
    expected_state: usize,
    expected_action: usize,
}

/// Compares a task's plant with recorded rows, fed in their order.
pub struct Calibration {
    task: &'static Task,
    one_step: Comparison,
    replay: Comparison,
    transitions: u64,
    episodes: u64,
    recorded_cost_mismatches: u64,
}

/// A plant and how far it was off.
struct Comparison {
    plant: Box<dyn Plant>,
    /// Sum of squares and largest magnitude of the error of each entry.
    entries: Vec<(f64, f64)>,
    reward_max_abs: f64,
    cost_mismatches: u64,
}

/// How far a plant is from a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CalibrationReport {
    /// The task.
    pub task: &'static str,
    /// Rows compared.
    pub transitions: u64,
    /// Episodes that they form.
    pub episodes: u64,
    /// From each recorded observation.
    pub one_step: Deviation,
    /// From the first observation of each episode on.
    pub replay: Deviation,
    /// Rows where the plant's cost of the recorded next observation is not the recorded one.
    pub recorded_cost_mismatches: u64,
}

/// How far predictions were off.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Deviation {
    /// Root mean square error of each entry of the observation `[S]`.
    pub observation_rms: Vec<f64>,
    /// Largest error of each entry of the observation `[S]`.
    pub observation_max_abs: Vec<f64>,
    /// Largest error of the reward.
    pub reward_max_abs: f64,
    /// Rows where the cost is not the recorded one.
    pub cost_mismatches: u64,
}

impl Calibration {
    /// An empty comparison with the plant of `task`.
    ///
    /// # Errors
    /// [`TaskError::NotNative`]
    pub fn new(task: &'static Task) -> Result<Self, TaskError> {
        let comparison = || {
            let plant = task.plant()?;
            Ok(Comparison { plant, entries: vec![(0.0, 0.0); task.state], reward_max_abs: 0.0, cost_mismatches: 0 })
        };
        let (one_step, replay) = (comparison()?, comparison()?);
        Ok(Self { task, one_step, replay, transitions: 0, episodes: 0, recorded_cost_mismatches: 0 })
    }

    /// Compares one more row. The very first must open an episode.
    ///
    /// # Errors
    /// [`SizeError`]; the row is not counted then.
    pub fn push(&mut self, row: &Transition<'_>) -> Result<(), SizeError> {
        let (state, action) = (row.observation.len(), row.action.len());
        if (state, action, row.next_observation.len()) != (self.task.state, self.task.action, state) {
            let Task { name: task, state: expected_state, action: expected_action, .. } = *self.task;
            return Err(SizeError { task, state, action, expected_state, expected_action });
        }
        if row.first {
            self.replay.plant.set_observation(row.observation);
            self.episodes += 1;
        }
        self.replay.advance(row);

        self.one_step.plant.set_observation(row.next_observation);
        self.recorded_cost_mismatches += u64::from(self.one_step.plant.cost() != f64::from(row.cost));
        self.one_step.plant.set_observation(row.observation);
        self.one_step.advance(row);
        self.transitions += 1;
        Ok(())
    }

    /// What was found so far.
    pub fn report(&self) -> CalibrationReport {
        CalibrationReport {
            task: self.task.name,
            transitions: self.transitions,
            episodes: self.episodes,
            one_step: self.one_step.deviation(self.transitions),
            replay: self.replay.deviation(self.transitions),
            recorded_cost_mismatches: self.recorded_cost_mismatches,
        }
    }
}

impl Comparison {
    /// Does the row's action and takes down how far the plant is off.
    fn advance(&mut self, row: &Transition<'_>) {
        let outcome = self.plant.step(row.action);
        let mut predicted = vec![0.0; self.entries.len()];
        self.plant.observe(&mut predicted);
        for ((squares, largest), (predicted, recorded)) in
            self.entries.iter_mut().zip(predicted.iter().zip(row.next_observation))
        {
            let error = f64::from(*predicted) - f64::from(*recorded);
            *squares += error * error;
            *largest = largest.max(error.abs());
        }
        self.reward_max_abs = self.reward_max_abs.max((outcome.reward - f64::from(row.reward)).abs());
        self.cost_mismatches += u64::from(outcome.cost != f64::from(row.cost));
    }

    fn deviation(&self, transitions: u64) -> Deviation {
        let rms = |squares: f64| if transitions == 0 { 0.0 } else { (squares / transitions as f64).sqrt() };
        Deviation {
            observation_rms: self.entries.iter().map(|(squares, _)| rms(*squares)).collect(),
            observation_max_abs: self.entries.iter().map(|(_, largest)| *largest).collect(),
            reward_max_abs: self.reward_max_abs,
            cost_mismatches: self.cost_mismatches,
        }
    }
}

impl fmt::Display for CalibrationReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { one_step, replay, .. } = self;
        writeln!(f, "plant of {} against {} transitions, {} episodes", self.task, self.transitions, self.episodes)?;
        writeln!(f, "{:<16}{:>24}{:>26}", "", "one step", "replay of episodes")?;
        writeln!(f, "{:<16}{:>12}{:>12}{:>14}{:>12}", "observation", "rms", "max", "rms", "max")?;
        let entries = (one_step.observation_rms.iter().zip(&one_step.observation_max_abs))
            .zip(replay.observation_rms.iter().zip(&replay.observation_max_abs));
        for (entry, ((rms, max), (replay_rms, replay_max))) in entries.enumerate() {
            writeln!(f, "{entry:<16}{rms:>12.1e}{max:>12.1e}{replay_rms:>14.1e}{replay_max:>12.1e}")?;
        }
        let (step, all) = (one_step.reward_max_abs, replay.reward_max_abs);
        writeln!(f, "{:<16}{:>12}{step:>12.1e}{:>14}{all:>12.1e}", "reward", "", "")?;
        let (step, all) = (one_step.cost_mismatches, replay.cost_mismatches);
        writeln!(f, "{:<16}{:>12}{step:>12}{:>14}{all:>12}", "wrong costs", "", "")?;
        write!(f, "wrong costs of recorded next observations: {}", self.recorded_cost_mismatches)
    }
}

#[cfg(test)]
mod tests;
