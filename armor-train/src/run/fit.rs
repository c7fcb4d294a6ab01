//! Training from the first step, or the last checkpoint, to the end.

use std::path::Path;

use firmware_sim::file;

use super::record::Record;
use super::{Alarm, Checkpoint, Provenance, RunError, Window, check_sizes};
use crate::config::Config;
use crate::data::Dataset;
use crate::learner::Learner;

/// Steps between checkpoints, a multiple of the steps of a metrics row.
const CHECKPOINT_STEPS: u64 = 1_000;
/// The effective configuration.
pub const CONFIG_FILE: &str = "config.toml";

/// Who looks on while a run trains.
pub trait Watch {
    /// Called after every step, with the steps done and the metrics since the last row.
    fn step(&mut self, step: u64, window: &Window);
    /// Called once for each cause of alarm.
    fn alarm(&mut self, _alarm: &Alarm) {}
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
    if config.unfinished != data.unfinished() {
        return Err(RunError::Unfinished);
    }
    let perturbed = (!config.perturbation().is_none()).then(|| data.perturbed(config.perturbation(), config.seed));
    let data = perturbed.as_ref().unwrap_or(data);
    let config = &config.resolved(data);
    let (mut learner, mut window, mut record) = start(config, data, folder, resume)?;
    while learner.state().step < config.steps {
        window.push(&learner.step());
        let step = learner.state().step;
        watch.step(step, &window);
        if let Some(column) = window.not_finite() {
            record.not_finite(step, column, watch);
            record.write(folder)?;
            return Err(RunError::Diverged { step, column });
        }
        if window.is_full() {
            record.row(&learner, &mut window, watch);
            record.write(folder)?;
        }
        let stop = watch.wants_stop();
        if stop || step.is_multiple_of(CHECKPOINT_STEPS) || step == config.steps {
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
) -> Result<(Learner<'d, f32>, Window, Record), RunError> {
    file::sweep(folder);
    let provenance = Provenance::new(config, data);
    let exists = folder.join(Checkpoint::FILE).exists();
    match (resume, exists) {
        (false, true) => Err(RunError::Taken { folder: folder.into() }),
        (true, false) => Err(RunError::NothingToResume { folder: folder.into() }),
        (true, true) => {
            let checkpoint = Checkpoint::read(folder)?;
            same_run(&checkpoint, config, data, folder)?;
            let learner = Learner::resume(config.clone(), data, checkpoint.state);
            let mut record = Record::new(config, data, &provenance, &learner);
            record.take_up(folder)?;
            write_config(config, folder)?;
            provenance.write(folder)?;
            Ok((learner, checkpoint.window, record))
        }
        (false, false) => {
            std::fs::create_dir_all(folder).map_err(|source| RunError::Folder { folder: folder.into(), source })?;
            write_config(config, folder)?;
            let learner = Learner::new(config.clone(), data);
            let (window, record) = (Window::default(), Record::new(config, data, &provenance, &learner));
            provenance.write(folder)?;
            record.write(folder)?;
            save(&learner, data, &window, folder)?;
            Ok((learner, window, record))
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
        state: learner.state(),
        window: window.clone(),
    };
    checkpoint.write(folder)
}

#[cfg(test)]
#[path = "fit_tests.rs"]
mod tests;
