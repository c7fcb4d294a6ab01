//! `firmware-sim trace`

use std::fmt;
use std::path::{Path, PathBuf};

use armor_core::units::CostLimit;
use armor_infer::Policy;
use serde::Serialize;
use thiserror::Error;

use super::output::{CommandResult, Output};
use crate::file::{self, FileError};
use crate::host::HostController;
use crate::image_file::ImageFile;
use crate::reference::{Chain, Reference};

/// Print every number of one denoising chain: the first control step of an
/// episode, in f64, and what the controller answers.
#[derive(Debug, clap::Args)]
pub(super) struct Trace {
    /// The policy image.
    image: PathBuf,
    /// A file with the state: numbers apart by commas or space, a JSON array if you like.
    #[arg(long, value_name = "FILE")]
    state: PathBuf,
    /// The remaining cost budget.
    #[arg(long, value_name = "K", value_parser = super::limit)]
    kappa: CostLimit,
    /// Seed of the chain's noise.
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

#[derive(Serialize)]
struct Report {
    task: String,
    rung: usize,
    seed: u64,
    tick: u64,
    kappa: f32,
    state: Vec<f32>,
    #[serde(flatten)]
    chain: Chain,
    controller_action: Vec<f32>,
    agreement_max_abs: f64,
}

/// A file does not hold a state.
#[derive(Debug, Error)]
enum StateError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{path}: {text} is no finite number; write the state as numbers apart by commas or space")]
    Number { path: String, text: String },
    #[error("{path} holds {actual} numbers and the policy senses {expected}; give one for each state entry")]
    Length { path: String, actual: usize, expected: usize },
}

impl Trace {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let file = ImageFile::read(&self.image)?;
        let image = file.image()?;
        let manifest = image.manifest();
        let state = read_state(&self.state, manifest.shape.state.into())?;

        let mut controller = HostController::new(Policy::load(&image)?, self.kappa, self.seed)?;
        let step = controller.step(&state, 0.0);
        if let Some(fault) = step.fault {
            output.note(fault);
        }
        let rung = step.rung.unwrap_or_default();
        let chain = Reference::new(&image).chain(rung, &state, step.kappa, self.seed, 0);
        let controller_action: Vec<f32> = step.action.iter().take(chain.action.len()).copied().collect();
        let differences = controller_action.iter().zip(&chain.action).map(|(a, b)| (f64::from(*a) - b).abs());
        let agreement_max_abs = differences.fold(0.0, f64::max);
        output.report(&Report {
            task: manifest.task.into(),
            rung,
            seed: self.seed,
            tick: 0,
            kappa: step.kappa.to_f32(),
            state,
            chain,
            controller_action,
            agreement_max_abs,
        })
    }
}

fn read_state(path: &Path, expected: usize) -> Result<Vec<f32>, StateError> {
    let name = || path.display().to_string();
    let bytes = file::read(path)?;
    let text = String::from_utf8_lossy(&bytes);
    let state = numbers(&text).map_err(|text| StateError::Number { path: name(), text: text.into() })?;
    if state.len() != expected {
        return Err(StateError::Length { path: name(), actual: state.len(), expected });
    }
    Ok(state)
}

/// The numbers of a text, or what in it is none.
fn numbers(text: &str) -> Result<Vec<f32>, &str> {
    let text = text.trim();
    let text = text.strip_prefix('[').and_then(|text| text.strip_suffix(']')).unwrap_or(text);
    let words = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty());
    words.map(|word| word.parse().ok().filter(|value: &f32| value.is_finite()).ok_or(word)).collect()
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = serde_json::to_string_pretty(self).map_err(|_| fmt::Error)?;
        f.write_str(&text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_is_a_json_array_or_just_numbers() {
        for text in ["[1, -2.5, 3e-1]", "1 -2.5 0.3\n", "1,-2.5,0.3", "\n[1,\n-2.5,\n.3]\n"] {
            assert_eq!(numbers(text), Ok(vec![1.0, -2.5, 0.3]), "{text}");
        }
        assert_eq!(numbers(" \n"), Ok(vec![]));
        for (text, culprit) in [("1 two", "two"), ("[1, NaN]", "NaN"), ("1e60", "1e60"), ("[1", "[1")] {
            assert_eq!(numbers(text), Err(culprit));
        }
    }
}
