//! `armor-train fit`

use std::fmt;
use std::path::{Path, PathBuf};

use armor_core::units::CostLimit;
use firmware_sim::cli::output::{CommandResult, Output};
use firmware_sim::file;
use serde::Serialize;

use super::progress::Progress;
use crate::config::options::listing;
use crate::config::{Config, ConfigError, Given, Preset};
use crate::data::Dataset;
use crate::run::{self, Checkpoint, Outcome, RunError};

/// Train a policy on recorded data.
///
/// The run's folder holds its configuration, its metrics and its last
/// checkpoint. Ctrl-C saves and stops; the same command with --resume goes on.
///
/// Options start from a preset and the task's cost limit. The file of --config
/// replaces any of them, --set replaces those of the file, and the other flags
/// here win over both. `armor-train options` and docs/config.md explain every
/// key, docs/metrics.md the columns of metrics.csv; `armor-train report` draws
/// them.
#[derive(Debug, clap::Args)]
#[command(after_long_help = format!("Options of --set and --config:\n\n{}", listing()))]
pub(super) struct Fit {
    /// An HDF5 file in the DSRL layout.
    #[arg(long, value_name = "H5")]
    data: Option<PathBuf>,
    /// The task that was recorded, such as ball-run.
    #[arg(long, value_name = "T")]
    task: Option<String>,
    /// Cost limit of an episode; the paper's for the task, if not given.
    #[arg(long, value_name = "D", value_parser = firmware_sim::cli::limit)]
    limit: Option<CostLimit>,
    /// What the options start from; quick, if not given.
    #[arg(long)]
    preset: Option<Preset>,
    /// A TOML file with any of the options, such as the config.toml of a run.
    #[arg(long, value_name = "TOML")]
    config: Option<PathBuf>,
    /// Replace an option, as in --set eta=0.5; `armor-train options` lists them.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Training steps; the preset's, if not given.
    #[arg(long, value_parser = clap::value_parser!(u64).range(..1 << 63))]
    steps: Option<u64>,
    /// Seed of everything random; 0, if not given.
    #[arg(long, value_parser = clap::value_parser!(u64).range(..1 << 63))]
    seed: Option<u64>,
    /// Folder of the run.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Go on with the run in the folder.
    #[arg(long)]
    resume: bool,
}

#[derive(Serialize)]
struct Report {
    out: PathBuf,
    steps: u64,
    seconds: f64,
}

impl Fit {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let file = self.config.as_deref().map(|path| file::read(path).map(|bytes| (path, bytes))).transpose()?;
        let mut config = self.config(file).unwrap_or_else(|error| super::misuse(&error));
        let data = super::data::read(Path::new(&config.data), config.unfinished, output)?;
        config.data = absolute(Path::new(&config.data));
        let started = std::time::Instant::now();
        let outcome = train("training", &config, &data, &self.out, self.resume, output)?;
        if let Outcome::Stopped(step) = outcome {
            return Err(format!("stopped and saved at step {step}; the same command with --resume goes on").into());
        }
        output.report(&Report { out: self.out, steps: config.steps, seconds: started.elapsed().as_secs_f64() })
    }

    /// The configuration that the file of --config and the arguments say.
    fn config(&self, file: Option<(&Path, Vec<u8>)>) -> Result<Config, ConfigError> {
        let mut given = Given::default();
        if let Some((path, bytes)) = file {
            given.file(path, &String::from_utf8_lossy(&bytes))?;
        }
        for assignment in &self.set {
            given.set(assignment)?;
        }
        if let Some(data) = &self.data {
            given.insert("data", data.display().to_string());
        }
        if let Some(task) = &self.task {
            given.insert("task", task.as_str());
        }
        if let Some(limit) = self.limit {
            given.insert("limit", f64::from(limit.cost().to_f32()));
        }
        if let Some(preset) = self.preset {
            given.insert("preset", preset.name());
        }
        for (key, number) in [("steps", self.steps), ("seed", self.seed)] {
            if let Some(number) = number {
                given.insert(key, number as i64);
            }
        }
        let config = given.config()?;
        config.check()?;
        Ok(config)
    }
}

/// The path from the root, so that a run finds its data from any folder.
pub(super) fn absolute(path: &Path) -> String {
    std::path::absolute(path).unwrap_or_else(|_| path.into()).display().to_string()
}

/// Trains with a progress bar.
pub(super) fn train(
    label: &str,
    config: &Config,
    data: &Dataset,
    folder: &Path,
    resume: bool,
    output: Output,
) -> Result<Outcome, RunError> {
    let start = if resume && folder.join(Checkpoint::FILE).exists() { Checkpoint::read(folder)?.state.step } else { 0 };
    let mut progress = Progress::new(label, start, config.steps, output);
    let outcome = run::fit(config, data, folder, resume, &mut progress);
    progress.finish();
    outcome
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "trained {} steps in {:.0} s", self.steps, self.seconds)?;
        writeln!(f, "run folder          {}", self.out.display())?;
        write!(f, "curves              armor-train report {} -o report.html", self.out.display())
    }
}
