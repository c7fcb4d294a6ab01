//! Why a recording cannot be used.

use std::io;
use std::path::PathBuf;

use armor_core::units::Cost;
use serde::Serialize;
use thiserror::Error;

use super::key::Key;

/// A file that cannot be used, and its first fault.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{}: {fault}", file.display())]
pub struct DataError {
    /// The file as it was named by the caller.
    pub file: PathBuf,
    /// What is wrong with it.
    pub fault: Fault,
}

/// One fault of a recording, with where it first occurs and what to do.
///
/// Rows count transitions from 0; `count` counts values, so a row of bad
/// actions counts once for every bad entry.
#[derive(Clone, Debug, PartialEq, Error, Serialize)]
#[serde(tag = "fault", rename_all = "snake_case")]
pub enum Fault {
    /// No file of that name.
    #[error("no such file; name an HDF5 file in the DSRL layout")]
    NotFound,
    /// The operating system refused to read the file.
    #[error("cannot be read: {reason}")]
    Unreadable {
        /// The system's words.
        reason: String,
    },
    /// The bytes carry no HDF5 signature.
    #[error("not an HDF5 file ({bytes} bytes without the signature); a recording is HDF5 in the DSRL layout")]
    NotHdf5 {
        /// Length of the file.
        bytes: u64,
    },
    /// The file is shorter than its superblock says.
    #[error("cut short: {bytes} bytes of {expected}; copy or download it again")]
    Truncated {
        /// Length of the file.
        bytes: u64,
        /// Length that the superblock states.
        expected: u64,
    },
    /// HDF5 structures or compressed data that cannot be decoded.
    #[error("damaged HDF5 file: {reason}; copy or download it again")]
    Damaged {
        /// The HDF5 reader's words.
        reason: String,
    },
    /// A part of HDF5 that is not read here: a newer file format, another filter than gzip, shuffle
    /// and the like, data kept in other files.
    #[error("HDF5 of a kind that is not read here: {reason}; write it with libver v114 or earlier and gzip")]
    Unsupported {
        /// The HDF5 reader's words.
        reason: String,
    },
    /// A data set of the DSRL layout is missing.
    #[error("no data set `{key}` in the root, only {}; rename the one that holds it, or record it", list(.present))]
    MissingKey {
        /// The missing data set.
        key: Key,
        /// The data sets that are there.
        present: Vec<String>,
    },
    /// A data set holds neither numbers nor flags of a kind that is read.
    #[error("`{key}` has the type {found}; write it as {}", .key.types())]
    UnsupportedType {
        /// The data set.
        key: Key,
        /// Its type in the file.
        found: String,
    },
    /// A data set has the wrong number of dimensions, or a width no policy image can hold.
    #[error("`{key}` has the shape {}; write it as {}", tuple(.shape), .key.shape())]
    WrongShape {
        /// The data set.
        key: Key,
        /// Its shape in the file.
        shape: Vec<u64>,
    },
    /// Two data sets of states have different widths.
    #[error("`observations` has {observations} entries a state but `next_observations` has {next_observations}")]
    WidthsDiffer {
        /// Width of `observations`.
        observations: u64,
        /// Width of `next_observations`.
        next_observations: u64,
    },
    /// A data set has another number of rows than the others.
    #[error("`{key}` has {rows} rows, most have {expected}; every transition needs one row in each data set")]
    LengthsDiffer {
        /// The data set.
        key: Key,
        /// Its rows.
        rows: u64,
        /// The rows that most data sets have.
        expected: u64,
    },
    /// No transitions.
    #[error("no transitions: every data set has 0 rows")]
    Empty,
    /// A number that is NaN, infinite, or beyond the range of f32.
    #[error("`{key}` row {row} is NaN, infinite or too large ({count} in all); drop that trajectory")]
    NotFinite {
        /// The data set.
        key: Key,
        /// First row.
        row: usize,
        /// How many values.
        count: usize,
    },
    /// A cost below 0, or beyond what a controller's budget can count.
    #[error("`costs` row {row} is {value} ({count} in all); a cost is at least 0 and at most {}", Cost::MAX)]
    CostOutOfRange {
        /// First row.
        row: usize,
        /// Its cost.
        value: f32,
        /// How many values.
        count: usize,
    },
    /// An action that clipping to `[-1, 1]` would change beyond rounding.
    #[error("`actions` row {row} holds {value} ({count} in all); scale the actions to [-1, 1]")]
    ActionOutOfRange {
        /// First row.
        row: usize,
        /// The first such entry.
        value: f32,
        /// How many values.
        count: usize,
    },
    /// A flag other than 0 and 1.
    #[error("`{key}` row {row} is {value} ({count} in all); a flag is 0 or 1")]
    InvalidFlag {
        /// The data set.
        key: Key,
        /// First row.
        row: usize,
        /// Its value.
        value: f32,
        /// How many values.
        count: usize,
    },
    /// No terminal and no timeout anywhere.
    #[error("no episode ends in {rows} rows; set `timeouts` (or `terminals`) to 1 on the last row of each episode")]
    NoEpisodeEnd {
        /// Rows of the recording.
        rows: usize,
    },
}

impl From<io::Error> for Fault {
    fn from(error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::NotFound => Self::NotFound,
            _ => Self::Unreadable { reason: error.to_string() },
        }
    }
}

/// Names from a file, quoted, for a message.
fn list(names: &[String]) -> String {
    match names {
        [] => "none".to_owned(),
        _ => names.iter().map(|name| format!("`{}`", name.escape_debug())).collect::<Vec<_>>().join(", "),
    }
}

/// A shape as it is written in Python.
fn tuple(shape: &[u64]) -> String {
    format!("({})", shape.iter().map(u64::to_string).collect::<Vec<_>>().join(", "))
}
