//! `armor-train fit`

use std::fmt;
use std::path::{Path, PathBuf};

use armor_core::units::CostLimit;
use firmware_sim::cli::output::{CommandResult, Output};
use serde::Serialize;

use super::progress::Progress;
use crate::config::{Config, ConfigError, Preset};
use crate::data::Dataset;
use crate::run::{self, Checkpoint, Outcome, RunError};

/// Train a policy on recorded data.
///
/// The run's folder holds its configuration, its metrics and its last
/// checkpoint. Ctrl-C saves and stops; the same command with --resume goes on.
///
/// `armor-train options` and docs/config.md say what can be --set,
/// docs/metrics.md what the columns of metrics.csv are; `armor-train report`
/// draws them.
#[derive(Debug, clap::Args)]
pub(super) struct Fit {
    /// An HDF5 file in the DSRL layout.
    #[arg(long, value_name = "H5")]
    data: PathBuf,
    /// The task that was recorded, such as ball-run.
    #[arg(long, value_name = "T")]
    task: String,
    /// Cost limit of an episode.
    #[arg(long, value_name = "D", value_parser = firmware_sim::cli::limit)]
    limit: CostLimit,
    /// What the options start from.
    #[arg(long, default_value = "quick")]
    preset: Preset,
    /// Replace an option, as in --set eta=0.5; `armor-train options` lists them.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Training steps; the preset's, if not given.
    #[arg(long)]
    steps: Option<u64>,
    /// Seed of everything random.
    #[arg(long, default_value_t = 0)]
    seed: u64,
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
        let config = self.config().unwrap_or_else(|error| super::misuse(&error));
        let data = super::data::read(&self.data, output)?;
        let started = std::time::Instant::now();
        let outcome = train("training", &config, &data, &self.out, self.resume, output)?;
        if let Outcome::Stopped(step) = outcome {
            return Err(format!("stopped and saved at step {step}; the same command with --resume goes on").into());
        }
        output.report(&Report { out: self.out, steps: config.steps, seconds: started.elapsed().as_secs_f64() })
    }

    /// The configuration that the arguments say.
    fn config(&self) -> Result<Config, ConfigError> {
        let mut config = self.preset.config(&self.task, f64::from(self.limit.cost().to_f32()));
        config.seed = self.seed;
        config.steps = self.steps.unwrap_or(config.steps);
        for assignment in &self.set {
            config.set(assignment)?;
        }
        config.data = absolute(&self.data);
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
