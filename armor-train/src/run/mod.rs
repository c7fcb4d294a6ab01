//! A training run and its folder.
//!
//! ```text
//! DIR/config.toml           the effective configuration
//! DIR/provenance.json       version, commit, data, and what the data's values span
//! DIR/metrics.csv           one row every 100 steps
//! DIR/speed.csv             steps per second, the only file that differs from run to run
//! DIR/alarms.log            what went wrong, and what to try
//! DIR/checkpoint.postcard   all that changes from step to step
//! ```
//!
//! Every file is written aside and renamed, the checkpoint last: after a kill
//! at any moment the folder holds the last whole checkpoint, and a resumed run
//! has the bits of one never stopped.

mod alarm;
mod checkpoint;
mod columns;
mod fit;
mod metrics;
mod provenance;
mod record;
mod table;

use std::path::PathBuf;

use firmware_sim::file::FileError;
use firmware_sim::host;
use firmware_sim::task::Task;

use crate::config::{Config, ConfigError};
use crate::data::{DataError, Dataset};

pub use alarm::{Alarm, Cause};
pub use checkpoint::Checkpoint;
pub use columns::{COLUMNS, Column, SPEED_COLUMNS};
pub use fit::{CONFIG_FILE, Outcome, Watch, fit};
pub use metrics::{Row, Window};
pub use provenance::Provenance;
pub use record::{ALARMS_FILE, METRICS_FILE, SPEED_FILE};
pub use table::Table;

/// Why a run cannot start, go on, or be read.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A file could not be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The folder could not be made.
    #[error("cannot make the folder {}: {source}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The recorded data cannot be used.
    #[error(transparent)]
    Data(#[from] DataError),
    /// The configuration cannot be used.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The data has not the sizes of the task.
    #[error(
        "the data has {state} state and {action} action entries, but {task} has {expected_state} and {expected_action}; name the task that was recorded"
    )]
    Sizes {
        /// The task.
        task: String,
        /// State entries of the data.
        state: usize,
        /// Action entries of the data.
        action: usize,
        /// State entries of the task.
        expected_state: usize,
        /// Action entries of the task.
        expected_action: usize,
    },
    /// No controller could fly the policy, and so it could not be exported.
    #[error("a policy with {size} {what} could not be exported; {capacity} is the most that a controller here flies")]
    TooLarge {
        /// What there is too much of.
        what: &'static str,
        /// How much.
        size: usize,
        /// The most that is flown.
        capacity: usize,
    },
    /// The folder already holds a run.
    #[error("{} already holds a run; add --resume to go on with it, or choose another --out", folder.display())]
    Taken {
        /// The folder.
        folder: PathBuf,
    },
    /// There is nothing to go on with.
    #[error("{} holds no checkpoint; leave out --resume to start a run there", folder.display())]
    NothingToResume {
        /// The folder.
        folder: PathBuf,
    },
    /// The folder holds no run.
    #[error("{} holds no run; name the folder that was given to fit as --out", folder.display())]
    NoRun {
        /// The folder.
        folder: PathBuf,
    },
    /// The checkpoint is damaged or not one.
    #[error("{} is no whole checkpoint of this version; restore a copy, or start the run anew", path.display())]
    Checkpoint {
        /// The checkpoint.
        path: PathBuf,
    },
    /// The checkpoint comes from another configuration.
    #[error("the run in {} has another `{key}`; resume it with the options it was started with", folder.display())]
    OtherConfig {
        /// The folder.
        folder: PathBuf,
        /// The first option that differs.
        key: String,
    },
    /// The run has gone on for longer.
    #[error("the run in {} has done {done} steps; resume it with at least as many", folder.display())]
    Longer {
        /// The folder.
        folder: PathBuf,
        /// Steps that it has done.
        done: u64,
    },
    /// The checkpoint comes from other data.
    #[error("the run in {} was started with other data; resume it with the file it was started with", folder.display())]
    OtherData {
        /// The folder.
        folder: PathBuf,
    },
    /// The data was read with other rows than the configuration wants.
    #[error("the data was read with another `unfinished` than the run's; read it with the run's")]
    Unfinished,
    /// A table has other columns than this version writes.
    #[error("{} has other columns than this version writes; restore it, or start the run anew", path.display())]
    Columns {
        /// The table.
        path: PathBuf,
    },
    /// A line of a table is no row of numbers.
    #[error("line {line} of {} is no row of numbers; restore the file, or start the run anew", path.display())]
    Row {
        /// The table.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
    },
    /// A loss is no longer a number.
    #[error(
        "training diverged at step {step}: a loss is not finite ({column}); the last checkpoint is kept, alarms.log says what to try"
    )]
    Diverged {
        /// The step.
        step: u64,
        /// Column of `metrics.csv` that noticed it.
        column: &'static str,
    },
}

/// Whether data has the sizes of the task that a configuration names, and
/// whether the controller that exports the policy could fly it.
///
/// # Errors
/// [`RunError::Sizes`]. A name that is no task of the table is the user's own, and has any size.
/// [`RunError::TooLarge`]
pub fn check_sizes(config: &Config, data: &Dataset) -> Result<(), RunError> {
    if let Ok(task) = Task::named(&config.task)
        && (task.state, task.action) != (data.state_dim(), data.action_dim())
    {
        return Err(RunError::Sizes {
            task: config.task.clone(),
            state: data.state_dim(),
            action: data.action_dim(),
            expected_state: task.state,
            expected_action: task.action,
        });
    }
    let sizes = [
        ("state entries", data.state_dim(), host::STATE),
        ("action entries", data.action_dim(), host::ACTION),
        ("`hidden` units", config.hidden, host::HIDDEN),
        ("`kappa_hidden` units", config.kappa_hidden, host::HIDDEN),
        ("`kappa_embedding` entries", config.kappa_embedding, host::HIDDEN),
    ];
    match sizes.into_iter().find(|(_, size, capacity)| size > capacity) {
        Some((what, size, capacity)) => Err(RunError::TooLarge { what, size, capacity }),
        None => Ok(()),
    }
}
