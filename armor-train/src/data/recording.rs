//! A recording as it stands in its file, and what must hold for its values.

use std::io;
use std::path::Path;

use armor_core::units::Cost;

use super::error::{DataError, Fault};
use super::hdf5::{self, Column, Contents};
use super::key::Key;

/// How far an action may lie beyond `[-1, 1]` and still be taken for a rounding
/// error that clipping mends (O-4); one part in a thousand of the bound.
const ACTION_TOLERANCE: f32 = 1e-3;

/// The seven data sets of a DSRL file; vectors row-major.
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
    /// SHA-256 of the file; zeros if there is none.
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

    /// Reads a file whole.
    ///
    /// # Errors
    /// [`DataError`] with the first [`Fault`]; [`check`](super::check) lists them all.
    pub fn read(path: &Path) -> Result<Self, DataError> {
        read_bytes(path).and_then(Self::from_bytes).map_err(|fault| DataError { file: path.to_owned(), fault })
    }

    /// Reads the bytes of an HDF5 file.
    ///
    /// # Errors
    /// The first [`Fault`].
    pub fn from_bytes(bytes: Vec<u8>) -> Result<Self, Fault> {
        // `Err` always carries a fault.
        Self::or_faults(bytes).map_err(|faults| faults.into_iter().next().unwrap_or(Fault::Empty))
    }

    /// Reads a file whole, or names everything that is wrong with it.
    pub(super) fn read_or_faults(path: &Path) -> Result<Self, Vec<Fault>> {
        read_bytes(path).map_err(|fault| vec![fault]).and_then(Self::or_faults)
    }

    fn or_faults(bytes: Vec<u8>) -> Result<Self, Vec<Fault>> {
        let Contents { sha256, columns, mut faults } = hdf5::parse(bytes).map_err(|fault| vec![fault])?;
        for (key, column) in Key::ALL.into_iter().zip(&columns) {
            if let Some(column) = column {
                faults.extend(value_faults(key, column.width, &column.values));
            }
        }
        if let [.., Some(terminals), Some(timeouts)] = &columns {
            let ends = terminals.values.iter().chain(&timeouts.values).any(|&flag| flag != 0.0);
            faults.extend(no_end(terminals.values.len(), ends));
        }
        match (columns, faults.is_empty()) {
            ([Some(o), Some(n), Some(a), Some(rewards), Some(costs), Some(terminals), Some(timeouts)], true) => {
                Ok(Self {
                    state_dim: o.width,
                    action_dim: a.width,
                    observations: o.values,
                    next_observations: n.values,
                    actions: a.values,
                    rewards: rewards.values,
                    costs: costs.values,
                    terminals: flags(&terminals),
                    timeouts: flags(&timeouts),
                    sha256,
                })
            }
            _ => Err(faults),
        }
    }

    /// The first fault of a recording that was put together in memory.
    ///
    /// # Errors
    /// A [`Fault`] as for a file.
    pub(super) fn validate(&self) -> Result<(), Fault> {
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
        if rows == 0 {
            return Err(Fault::Empty);
        }
        let values = [
            (Key::Observations, s, &self.observations),
            (Key::NextObservations, s, &self.next_observations),
            (Key::Actions, a, &self.actions),
            (Key::Rewards, 1, &self.rewards),
            (Key::Costs, 1, &self.costs),
        ];
        let faults = values.into_iter().flat_map(|(key, width, values)| value_faults(key, width, values));
        let ends = self.terminals.iter().chain(&self.timeouts).any(|&flag| flag);
        faults.chain(no_end(rows, ends)).next().map_or(Ok(()), Err)
    }
}

fn read_bytes(path: &Path) -> Result<Vec<u8>, Fault> {
    std::fs::read(path).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => Fault::NotFound,
        _ => Fault::Unreadable { reason: error.to_string() },
    })
}

fn flags(column: &Column) -> Vec<bool> {
    column.values.iter().map(|&flag| flag != 0.0).collect()
}

fn no_end(rows: usize, ends: bool) -> Option<Fault> {
    (rows > 0 && !ends).then_some(Fault::NoEpisodeEnd { rows })
}

/// The faults of one data set's values, at most one of each kind.
fn value_faults(key: Key, width: usize, values: &[f32]) -> impl Iterator<Item = Fault> {
    let find = |bad: fn(f32) -> bool| {
        let at = values.iter().position(|&value| bad(value))?;
        let count = values.iter().filter(|&&value| bad(value)).count();
        Some((at / width, values[at], count))
    };
    let not_finite = find(|value| !value.is_finite()).map(|(row, _, count)| Fault::NotFinite { key, row, count });
    let own = match key {
        Key::Costs => find(is_no_cost).map(|(row, value, count)| Fault::CostOutOfRange { row, value, count }),
        Key::Actions => find(is_no_action).map(|(row, value, count)| Fault::ActionOutOfRange { row, value, count }),
        Key::Terminals | Key::Timeouts => {
            find(is_no_flag).map(|(row, value, count)| Fault::InvalidFlag { key, row, value, count })
        }
        Key::Observations | Key::NextObservations | Key::Rewards => None,
    };
    not_finite.into_iter().chain(own)
}

// What is not finite is a fault of its own, so each of these is false for it.

/// Whether the controller's budget cannot count it.
fn is_no_cost(value: f32) -> bool {
    value.is_finite() && !(0.0..=Cost::MAX.to_f32()).contains(&value)
}

fn is_no_action(value: f32) -> bool {
    value.is_finite() && value.abs() > 1.0 + ACTION_TOLERANCE
}

fn is_no_flag(value: f32) -> bool {
    value.is_finite() && value != 0.0 && value != 1.0
}
