//! A recording that is put together in memory.

use super::columns::{Columns, ends, no_end};
use super::error::Fault;
use super::key::Key;
use super::scan::Scan;
use super::states::States;

/// The seven data sets of the DSRL layout; vectors row-major.
///
/// [`Dataset::new`](super::Dataset::new) makes it ready for training. A file is
/// read by [`Dataset::read`](super::Dataset::read), which never holds this much.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// Entries of a state, `S`.
    pub state_dim: usize,
    /// Entries of an action, `A`.
    pub action_dim: usize,
    /// States, `N * S`.
    pub observations: Vec<f32>,
    /// States after the action, `N * S`.
    pub next_observations: Vec<f32>,
    /// Actions, `N * A`.
    pub actions: Vec<f32>,
    /// Rewards, `N`.
    pub rewards: Vec<f32>,
    /// Costs, `N`.
    pub costs: Vec<f32>,
    /// Ends by the task's own rule, `N`.
    pub terminals: Vec<bool>,
    /// Ends by the time limit, `N`.
    pub timeouts: Vec<bool>,
    /// SHA-256 of the file that it stands for; zeros if there is none.
    pub sha256: [u8; 32],
}

impl Recording {
    /// Adds the rows of another recording of the same sizes.
    pub fn append(&mut self, other: &Self) {
        self.observations.extend_from_slice(&other.observations);
        self.next_observations.extend_from_slice(&other.next_observations);
        self.actions.extend_from_slice(&other.actions);
        self.rewards.extend_from_slice(&other.rewards);
        self.costs.extend_from_slice(&other.costs);
        self.terminals.extend_from_slice(&other.terminals);
        self.timeouts.extend_from_slice(&other.timeouts);
    }

    /// The columns, once lengths and values were checked.
    ///
    /// # Errors
    /// The first [`Fault`], as for a file.
    pub(super) fn into_columns(self) -> Result<Columns, Fault> {
        self.check_lengths()?;
        let ends = ends(&self.terminals, &self.timeouts);
        if let Some(fault) = self.bad_values().chain(no_end(&ends)).next() {
            return Err(fault);
        }
        let mut states = States::new(self.state_dim, self.observations);
        for (row, next) in self.next_observations.chunks_exact(self.state_dim).enumerate() {
            states.push_next(row, next);
        }
        let Self { action_dim, actions, rewards, costs, sha256, .. } = self;
        Ok(Columns { states, action_dim, actions, rewards, costs, ends, sha256 })
    }

    fn check_lengths(&self) -> Result<(), Fault> {
        let rows = self.rewards.len();
        let (s, a) = (self.state_dim, self.action_dim);
        let lengths = [
            (Key::Observations, s, self.observations.len()),
            (Key::NextObservations, s, self.next_observations.len()),
            (Key::Actions, a, self.actions.len()),
            (Key::Costs, 1, self.costs.len()),
            (Key::Terminals, 1, self.terminals.len()),
            (Key::Timeouts, 1, self.timeouts.len()),
        ];
        for (key, width, length) in lengths {
            if !key.accepts_width(width as u64) || !length.is_multiple_of(width) {
                return Err(Fault::WrongShape { key, shape: vec![rows as u64, width as u64] });
            }
            if length / width != rows {
                return Err(Fault::LengthsDiffer { key, rows: (length / width) as u64, expected: rows as u64 });
            }
        }
        if rows == 0 { Err(Fault::Empty) } else { Ok(()) }
    }

    fn bad_values(&self) -> impl Iterator<Item = Fault> {
        let values = [
            (Key::Observations, self.state_dim, &self.observations),
            (Key::NextObservations, self.state_dim, &self.next_observations),
            (Key::Actions, self.action_dim, &self.actions),
            (Key::Rewards, 1, &self.rewards),
            (Key::Costs, 1, &self.costs),
        ];
        values.into_iter().flat_map(|(key, width, values)| {
            let mut scan = Scan::new(key);
            scan.look(0, width, values);
            scan.faults()
        })
    }
}
