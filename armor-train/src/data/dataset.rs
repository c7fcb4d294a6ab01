//! A recording made ready for training: trajectories, kappa, clipped actions.

use std::io::{Read, Seek};
use std::ops::Range;
use std::path::Path;

use super::columns::Columns;
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
    unfinished: usize,
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
}

impl Dataset {
    /// Reads a file and makes it ready.
    ///
    /// # Errors
    /// [`DataError`] with the first [`Fault`] of the file.
    pub fn read(path: &Path) -> Result<Self, DataError> {
        Columns::read(path).map(Self::split).map_err(|faults| DataError { file: path.to_owned(), fault: first(faults) })
    }

    /// Reads the bytes of an HDF5 file, a part at a time, and makes them ready.
    ///
    /// # Errors
    /// The first [`Fault`].
    pub fn from_reader(reader: impl Read + Seek + Send + 'static) -> Result<Self, Fault> {
        Columns::from_reader(reader).map(Self::split).map_err(first)
    }

    /// Makes a recording ready.
    ///
    /// # Errors
    /// The first [`Fault`] of the recording.
    pub fn new(recording: Recording) -> Result<Self, Fault> {
        recording.into_columns().map(Self::split)
    }

    /// Splits at terminal or timeout (O-3) and drops what follows the last end (O-1).
    pub(super) fn split(columns: Columns) -> Self {
        let Columns { states, action_dim, mut actions, mut rewards, mut costs, ends, sha256 } = columns;
        let ends: Vec<usize> = ends.iter().enumerate().filter_map(|(row, &end)| end.then_some(row + 1)).collect();
        let rows = ends.last().copied().unwrap_or(0);
        let unfinished = rewards.len() - rows;
        rewards.truncate(rows);
        costs.truncate(rows);
        actions.truncate(rows * action_dim);
        for action in &mut actions {
            *action = action.clamp(-1.0, 1.0); // O-4
        }

        let trajectories = Vec::with_capacity(ends.len());
        let kappas = vec![0.0; rows];
        let mut dataset =
            Self { states, action_dim, sha256, actions, rewards, costs, kappas, trajectories, unfinished };
        let mut start = 0;
        for end in ends {
            dataset.push_trajectory(start..end);
            start = end;
        }
        dataset
    }

    /// `kappa_t = sum of c_k, k >= t` (section 3.1), summed in f64 so that it is exact for whole costs.
    fn push_trajectory(&mut self, rows: Range<usize>) {
        let mut kappa = 0.0f64;
        for row in rows.clone().rev() {
            kappa += f64::from(self.costs[row]);
            self.kappas[row] = kappa as f32;
        }
        self.trajectories.push(Trajectory {
            reward_return: self.rewards[rows.clone()].iter().map(|&reward| f64::from(reward)).sum(),
            cost_return: kappa as f32,
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

    /// Rows after the last end mark, which were dropped (O-1).
    pub fn unfinished(&self) -> usize {
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

    /// Whether the trajectory ends with this row, by terminal or timeout (O-3).
    pub fn done(&self, row: usize) -> bool {
        self.trajectories[self.trajectory(row)].rows.end == row + 1
    }

    /// Index of the row's trajectory in [`Dataset::trajectories`].
    pub fn trajectory(&self, row: usize) -> usize {
        self.trajectories.partition_point(|trajectory| trajectory.rows.end <= row)
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
