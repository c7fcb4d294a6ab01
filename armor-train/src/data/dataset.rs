//! A recording made ready for training: trajectories, kappa, clipped actions.

use std::io::{Read, Seek};
use std::ops::Range;
use std::path::Path;

use super::columns::Columns;
use super::ending::{Ending, Unfinished};
use super::error::{DataError, Fault};
use super::recording::Recording;
use super::states::States;

/// Transitions of whole trajectories, addressed by row `0 .. len()`.
///
/// An accessor that takes a row panics beyond `len()`, as indexing a slice does.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    /// Of all rows of the recording, also of those that were dropped.
    states: States,
    action_dim: usize,
    sha256: [u8; 32],
    actions: Vec<f32>,
    rewards: Vec<f32>,
    costs: Vec<f32>,
    kappas: Vec<f32>,
    trajectories: Vec<Trajectory>,
    /// Rows after the last end mark.
    after_last_end: usize,
    unfinished: Unfinished,
}

/// One episode of a data set.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// Its rows.
    pub rows: Range<usize>,
    /// Reward return, undiscounted.
    pub reward_return: f64,
    /// Cost return `C_i`, undiscounted (section 3.3); kappa of its first row.
    pub cost_return: f32,
    /// How it ends.
    pub ending: Ending,
}

impl Dataset {
    /// Reads a file and makes it ready, without what follows the last end mark.
    ///
    /// # Errors
    /// [`DataError`] with the first [`Fault`] of the file.
    pub fn read(path: &Path) -> Result<Self, DataError> {
        Self::read_with(path, Unfinished::Drop)
    }

    /// Reads a file and makes it ready.
    ///
    /// # Errors
    /// [`DataError`] with the first [`Fault`] of the file.
    pub fn read_with(path: &Path, unfinished: Unfinished) -> Result<Self, DataError> {
        let columns = Columns::read(path);
        columns
            .map(|columns| Self::split(columns, unfinished))
            .map_err(|faults| DataError { file: path.to_owned(), fault: first(faults) })
    }

    /// Reads the bytes of an HDF5 file, a part at a time, and makes them ready, without what
    /// follows the last end mark.
    ///
    /// # Errors
    /// The first [`Fault`].
    pub fn from_reader(reader: impl Read + Seek + Send + 'static) -> Result<Self, Fault> {
        Columns::from_reader(reader).map(|columns| Self::split(columns, Unfinished::Drop)).map_err(first)
    }

    /// Makes a recording ready, without what follows the last end mark.
    ///
    /// # Errors
    /// The first [`Fault`] of the recording.
    pub fn new(recording: Recording) -> Result<Self, Fault> {
        Self::with_unfinished(recording, Unfinished::Drop)
    }

    /// Makes a recording ready.
    ///
    /// # Errors
    /// The first [`Fault`] of the recording.
    pub fn with_unfinished(recording: Recording, unfinished: Unfinished) -> Result<Self, Fault> {
        recording.into_columns().map(|columns| Self::split(columns, unfinished))
    }

    /// Splits at terminal or timeout (O-3), and drops or keeps what follows the last end (O-1).
    pub(super) fn split(columns: Columns, unfinished: Unfinished) -> Self {
        let Columns { states, action_dim, mut actions, mut rewards, mut costs, ends, sha256 } = columns;
        let mut ends: Vec<(usize, Ending)> =
            ends.into_iter().enumerate().filter_map(|(row, ending)| Some((row + 1, ending?))).collect();
        let last_end = ends.last().map_or(0, |&(end, _)| end);
        let after_last_end = rewards.len() - last_end;
        if unfinished == Unfinished::Keep && after_last_end > 0 {
            ends.push((rewards.len(), Ending::Unfinished));
        }
        let rows = ends.last().map_or(0, |&(end, _)| end);
        rewards.truncate(rows);
        costs.truncate(rows);
        actions.truncate(rows * action_dim);
        for action in &mut actions {
            *action = action.clamp(-1.0, 1.0); // O-4
        }

        let trajectories = Vec::with_capacity(ends.len());
        let kappas = vec![0.0; rows];
        let mut dataset = Self {
            states,
            action_dim,
            sha256,
            actions,
            rewards,
            costs,
            kappas,
            trajectories,
            after_last_end,
            unfinished,
        };
        let mut start = 0;
        for (end, ending) in ends {
            dataset.push_trajectory(start..end, ending);
            start = end;
        }
        dataset
    }

    /// Counts what follows from rewards and costs.
    pub(super) fn count_again(&mut self) {
        for Trajectory { rows, ending, .. } in std::mem::take(&mut self.trajectories) {
            self.push_trajectory(rows, ending);
        }
    }

    /// Reward and cost of a row; [`Dataset::count_again`] must follow a change.
    pub(super) fn signals_mut(&mut self, row: usize) -> (&mut f32, &mut f32) {
        (&mut self.rewards[row], &mut self.costs[row])
    }

    /// `kappa_t = sum of c_k, k >= t` (section 3.1), summed in f64 so that it is exact for whole costs.
    fn push_trajectory(&mut self, rows: Range<usize>, ending: Ending) {
        let mut kappa = 0.0f64;
        for row in rows.clone().rev() {
            kappa += f64::from(self.costs[row]);
            self.kappas[row] = kappa as f32;
        }
        self.trajectories.push(Trajectory {
            reward_return: self.rewards[rows.clone()].iter().map(|&reward| f64::from(reward)).sum(),
            cost_return: kappa as f32,
            ending,
            rows,
        });
    }

    /// Transitions, `N`.
    pub fn len(&self) -> usize {
        self.rewards.len()
    }

    /// Whether there are no transitions; never so for a data set that was read.
    pub fn is_empty(&self) -> bool {
        self.rewards.is_empty()
    }

    /// Entries of a state, `S`.
    pub fn state_dim(&self) -> usize {
        self.states.width()
    }

    /// Entries of an action, `A`.
    pub fn action_dim(&self) -> usize {
        self.action_dim
    }

    /// SHA-256 of the file.
    pub fn sha256(&self) -> &[u8; 32] {
        &self.sha256
    }

    /// Rows after the last end mark (O-1).
    pub fn after_last_end(&self) -> usize {
        self.after_last_end
    }

    /// What became of them.
    pub fn unfinished(&self) -> Unfinished {
        self.unfinished
    }

    /// The trajectories in the order of the file.
    pub fn trajectories(&self) -> &[Trajectory] {
        &self.trajectories
    }

    /// The largest kappa, which is the largest cost return.
    pub fn max_kappa(&self) -> f32 {
        self.trajectories.iter().map(|trajectory| trajectory.cost_return).fold(0.0, f32::max)
    }

    /// `s_t`, of length `S`.
    pub fn observation(&self, row: usize) -> &[f32] {
        self.states.observation(row)
    }

    /// `s_{t+1}`, of length `S`, as recorded.
    pub fn next_observation(&self, row: usize) -> &[f32] {
        self.states.next_observation(row)
    }

    /// `a_t`, of length `A`, clipped to `[-1, 1]` (O-4).
    pub fn action(&self, row: usize) -> &[f32] {
        &self.actions[row * self.action_dim..(row + 1) * self.action_dim]
    }

    /// `r_t` as recorded, unscaled.
    pub fn reward(&self, row: usize) -> f32 {
        self.rewards[row]
    }

    /// `c_t` as recorded, unscaled.
    pub fn cost(&self, row: usize) -> f32 {
        self.costs[row]
    }

    /// `kappa_t`, the undiscounted cost from this row to the end of its trajectory.
    pub fn kappa(&self, row: usize) -> f32 {
        self.kappas[row]
    }

    /// `kappa_{t+1} = kappa_t - c_t`, and 0 after the last row (O-2).
    ///
    /// Exact where costs are whole numbers; else to the rounding of f32.
    pub fn kappa_next(&self, row: usize) -> f32 {
        if self.done(row) { 0.0 } else { self.kappas[row + 1] }
    }

    /// Whether this row is the last of its trajectory.
    pub fn done(&self, row: usize) -> bool {
        self.trajectories[self.trajectory(row)].rows.end == row + 1
    }

    /// Index of the row's trajectory in [`Dataset::trajectories`].
    pub fn trajectory(&self, row: usize) -> usize {
        self.trajectories.partition_point(|trajectory| trajectory.rows.end <= row)
    }

    /// How the trajectory ends with this row; none where it goes on.
    pub fn ending(&self, row: usize) -> Option<Ending> {
        let trajectory = &self.trajectories[self.trajectory(row)];
        (trajectory.rows.end == row + 1).then_some(trajectory.ending)
    }

    /// `C_i` of the row's trajectory.
    pub fn trajectory_cost(&self, row: usize) -> f32 {
        self.trajectories[self.trajectory(row)].cost_return
    }

    /// Rows whose next observation is not the observation of the row after it, though the
    /// trajectory goes on.
    pub fn gaps(&self) -> impl Iterator<Item = usize> {
        let kept = self.states.breaks().iter().copied().take_while(|&row| row < self.len());
        kept.filter(|&row| !self.done(row))
    }
}

/// The fault to name where only one is; an error always carries one.
fn first(faults: Vec<Fault>) -> Fault {
    faults.into_iter().next().unwrap_or(Fault::Empty)
}
