//! `armor-train data ...`

use std::path::{Path, PathBuf};

use armor_core::units::CostLimit;
use firmware_sim::calibrate::{Calibration, CalibrationReport, Transition};
use firmware_sim::cli::output::{CommandResult, Output};
use firmware_sim::file;
use firmware_sim::task::Task;

use crate::collect::collect;
use crate::config::Preset;
use crate::data::{self, Dataset, Stats, Unfinished};

/// Look at recorded data.
#[derive(Debug, clap::Subcommand)]
pub(super) enum Data {
    /// Count a file: the paper's Table 1 and the spread of returns.
    Stats {
        /// An HDF5 file in the DSRL layout.
        file: PathBuf,
        /// Cost limit of an episode.
        #[arg(long, value_name = "D", value_parser = firmware_sim::cli::limit)]
        limit: CostLimit,
        /// Weight of feasible trajectories (Eq. 6), for the mass they get.
        #[arg(long, default_value_t = Preset::Paper.config("", 0.0).beta, value_parser = beta)]
        beta: f64,
    },
    /// Record a native plant under many driving styles, good and bad.
    ///
    /// The recording is thinned towards the paper's Table 1. The same seed
    /// records the same file.
    Collect {
        /// The native task.
        #[arg(long, value_parser = Task::named)]
        task: &'static Task,
        /// The HDF5 file to write, in the DSRL layout.
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
        /// Trajectories; those of Table 1, if not given.
        #[arg(long, value_name = "N", value_parser = trajectories)]
        trajectories: Option<usize>,
        /// Decides styles, starts and noise.
        #[arg(long, default_value_t = 0)]
        seed: u64,
    },
    /// Name every fault of a file.
    Check {
        /// An HDF5 file in the DSRL layout.
        file: PathBuf,
    },
    /// Compare a native plant with a recording of its simulator.
    Calibrate {
        /// An HDF5 file in the DSRL layout.
        file: PathBuf,
        /// The native task.
        #[arg(long, value_parser = Task::named)]
        task: &'static Task,
    },
}

impl Data {
    pub(super) fn run(self, output: Output) -> CommandResult {
        match self {
            Self::Stats { file, limit, beta } => {
                let data = read(&file, Unfinished::Drop, output)?;
                output.report(&Stats::new(&data, limit, beta))
            }
            Self::Collect { task, out, trajectories, seed } => {
                let recording = collect(task, trajectories, seed)?;
                file::write(&out, &data::to_hdf5(&recording)?)?;
                let beta = Preset::Paper.config("", 0.0).beta;
                output.report(&Stats::new(
                    &read(&out, Unfinished::Drop, output)?,
                    CostLimit::new(task.cost_limit)?,
                    beta,
                ))
            }
            Self::Check { file } => {
                let report = data::check(&file);
                output.report(&report)?;
                if report.is_sound() {
                    Ok(())
                } else {
                    Err(format!("{} cannot be used: {} faults, named above", file.display(), report.faults.len())
                        .into())
                }
            }
            Self::Calibrate { file, task } => output.report(&calibrate(&read(&file, Unfinished::Drop, output)?, task)?),
        }
    }
}

/// A weight of feasible trajectories as an argument.
fn beta(text: &str) -> Result<f64, &'static str> {
    text.parse().ok().filter(|beta| (0.0..f64::INFINITY).contains(beta)).ok_or("it must be a number of at least 0")
}

/// A number of trajectories as an argument.
fn trajectories(text: &str) -> Result<usize, &'static str> {
    text.parse().ok().filter(|count| (1..=1_000_000).contains(count)).ok_or("it must be between 1 and 1000000")
}

/// Reads a file, and tells what is odd about it.
pub(super) fn read(file: &Path, unfinished: Unfinished, output: Output) -> Result<Dataset, data::DataError> {
    let data = Dataset::read_with(file, unfinished)?;
    for warning in data::Warning::all(&data, file) {
        output.note(format_args!("warning: {warning}"));
    }
    Ok(data)
}

/// Feeds all transitions to the plant of `task`.
pub(super) fn calibrate(data: &Dataset, task: &'static Task) -> Result<CalibrationReport, Box<dyn std::error::Error>> {
    let mut calibration = Calibration::new(task)?;
    for row in 0..data.len() {
        calibration.push(&Transition {
            first: data.trajectories()[data.trajectory(row)].rows.start == row,
            observation: data.observation(row),
            action: data.action(row),
            reward: data.reward(row),
            cost: data.cost(row),
            next_observation: data.next_observation(row),
        })?;
    }
    Ok(calibration.report())
}
