//! Training from the first step, or the last checkpoint, to the end.

use std::path::Path;

use firmware_sim::file;

use super::metrics::Table;
use super::{Checkpoint, RunError, Window, check_sizes};
use crate::config::Config;
use crate::data::Dataset;
use crate::learner::Learner;

/// Steps between checkpoints, a multiple of the steps of a metrics row.
const CHECKPOINT_STEPS: u64 = 1_000;
const CONFIG_FILE: &str = "config.toml";
const METRICS_FILE: &str = "metrics.csv";

/// Who looks on while a run trains.
pub trait Watch {
    /// Called after every step, with the steps done and the metrics since the last row.
    fn step(&mut self, step: u64, window: &Window);
    /// Whether the run shall save and stop.
    fn wants_stop(&self) -> bool;
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All steps are done.
    Done,
    /// It was asked to stop after this many steps, and saved.
    Stopped(u64),
}

/// Trains in `folder`: anew, or with `resume` from its last checkpoint, which
/// may also extend a finished run to a larger `config.steps`.
///
/// # Errors
/// [`RunError`]; the last checkpoint is kept whatever happens.
pub fn fit(
    config: &Config,
    data: &Dataset,
    folder: &Path,
    resume: bool,
    watch: &mut dyn Watch,
) -> Result<Outcome, RunError> {
    config.check()?;
    check_sizes(config, data)?;
    let (mut learner, mut window, mut table) = start(config, data, folder, resume)?;
    while learner.state().step < config.steps {
        window.push(&learner.step());
        let step = learner.state().step;
        watch.step(step, &window);
        if !window.is_finite() {
            return Err(RunError::Diverged { step });
        }
        if window.is_full() {
            table.push(&window.take_row(step, counterfactual_active(&learner)));
        }
        let stop = watch.wants_stop();
        if stop || step.is_multiple_of(CHECKPOINT_STEPS) || step == config.steps {
            file::write(&folder.join(METRICS_FILE), table.text().as_bytes())?;
            save(&learner, data, &window, folder)?;
        }
        if stop && step < config.steps {
            return Ok(Outcome::Stopped(step));
        }
    }
    Ok(Outcome::Done)
}

fn start<'d>(
    config: &Config,
    data: &'d Dataset,
    folder: &Path,
    resume: bool,
) -> Result<(Learner<'d, f32>, Window, Table), RunError> {
    let exists = folder.join(Checkpoint::FILE).exists();
    match (resume, exists) {
        (false, true) => Err(RunError::Taken { folder: folder.into() }),
        (true, false) => Err(RunError::NothingToResume { folder: folder.into() }),
        (true, true) => {
            let checkpoint = Checkpoint::read(folder)?;
            same_run(&checkpoint, config, data, folder)?;
            let text = file::read(&folder.join(METRICS_FILE))?;
            let table = Table::until(&String::from_utf8_lossy(&text), checkpoint.state.step);
            write_config(config, folder)?;
            Ok((Learner::resume(config.clone(), data, checkpoint.state), checkpoint.window, table))
        }
        (false, false) => {
            std::fs::create_dir_all(folder).map_err(|source| RunError::Folder { folder: folder.into(), source })?;
            write_config(config, folder)?;
            let learner = Learner::new(config.clone(), data);
            let (window, table) = (Window::default(), Table::new());
            file::write(&folder.join(METRICS_FILE), table.text().as_bytes())?;
            save(&learner, data, &window, folder)?;
            Ok((learner, window, table))
        }
    }
}

/// Whether a resumed run may differ in an option: its data may have been moved,
/// and it may go on longer, unless its rates fall along its length.
fn is_free(key: &str, config: &Config) -> bool {
    key == "data" || key == "steps" && config.final_rate == 1.0
}

/// Whether a checkpoint may go on under `config`.
fn same_run(checkpoint: &Checkpoint, config: &Config, data: &Dataset, folder: &Path) -> Result<(), RunError> {
    if checkpoint.data_sha256 != *data.sha256() {
        return Err(RunError::OtherData { folder: folder.into() });
    }
    let (before, now) = (checkpoint.config.options(), config.options());
    let differs = |key: &str, value| !is_free(key, config) && before.get(key) != Some(value);
    if let Some((key, _)) = now.iter().find(|(key, value)| differs(key, value)) {
        return Err(RunError::OtherConfig { folder: folder.into(), key: key.clone() });
    }
    match checkpoint.state.step {
        done if done > config.steps => Err(RunError::Longer { folder: folder.into(), done }),
        _ => Ok(()),
    }
}

fn write_config(config: &Config, folder: &Path) -> Result<(), RunError> {
    let text = config.options().to_string();
    Ok(file::write(&folder.join(CONFIG_FILE), text.as_bytes())?)
}

fn save(learner: &Learner<'_, f32>, data: &Dataset, window: &Window, folder: &Path) -> Result<(), RunError> {
    let checkpoint = Checkpoint {
        config: learner.config().clone(),
        data_sha256: *data.sha256(),
        state: learner.state().clone(),
        window: window.clone(),
    };
    checkpoint.write(folder)
}

/// Share of transitions whose counterfactual weight is above 1.
fn counterfactual_active(learner: &Learner<'_, f32>) -> f64 {
    let weights = &learner.weights().counterfactual;
    weights.iter().filter(|&&weight| weight > 1.0).count() as f64 / weights.len() as f64
}
