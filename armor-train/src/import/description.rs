//! What a policy's tensors do not say.

use armor_core::schedule::{MAX_STEPS, Noising};
use serde::Deserialize;

use crate::normaliser::Normaliser;

/// The TOML file beside the tensors. Unknown keys are errors.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// The task that the policy was trained for.
    pub task: String,
    /// Noise levels `N` of the chain, 1 to 64.
    pub steps: usize,
    /// The noise schedule, `vp` (if not given) or `cosine`.
    #[serde(default = "vp")]
    pub schedule: Noising,
    /// Largest cost limit that the policy may be given.
    pub cost_limit_max: f32,
    /// What the names of the tensors start with, such as `model.`.
    #[serde(default)]
    pub prefix: String,
    /// Mean of each state entry `[S]`; 0 if not given.
    pub state_mean: Option<Vec<f32>>,
    /// Standard deviation of each state entry `[S]`; 1 if not given.
    pub state_std: Option<Vec<f32>>,
    /// Smallest action `[A]`; -1 if not given.
    pub action_low: Option<Vec<f32>>,
    /// Largest action `[A]`; 1 if not given.
    pub action_high: Option<Vec<f32>>,
    /// What to do when no action can be computed `[A]`; 0 if not given.
    pub action_fallback: Option<Vec<f32>>,
}

const fn vp() -> Noising {
    Noising::Vp
}

/// Why a description is none.
#[derive(Debug, thiserror::Error)]
pub enum DescriptionError {
    /// It is no TOML of these keys.
    #[error("description, line {line}: {reason}")]
    Toml {
        /// Line of the file, from 1.
        line: usize,
        /// What is wrong.
        reason: String,
    },
    /// The number of noise levels is out of range.
    #[error("description: steps is {0}, but a chain has 1 to {MAX_STEPS} noise levels")]
    Steps(usize),
    /// A list has not an entry for each of the network's.
    #[error("description: {key} has {found} entries, the network has {expected}")]
    Length {
        /// The list.
        key: &'static str,
        /// Entries of the network.
        expected: usize,
        /// Entries of the list.
        found: usize,
    },
    /// A standard deviation is not above 0.
    #[error("description: state_std[{0}] is not a finite number above 0")]
    Deviation(usize),
}

impl Description {
    pub(super) fn parse(text: &str) -> Result<Self, DescriptionError> {
        let given: Self = toml::from_str(text).map_err(|error| {
            let before = error.span().and_then(|span| text.get(..span.start)).unwrap_or_default();
            let reason = error.message().replace('\n', ", ");
            DescriptionError::Toml { line: before.matches('\n').count() + 1, reason }
        })?;
        if !(1..=MAX_STEPS).contains(&given.steps) {
            return Err(DescriptionError::Steps(given.steps));
        }
        Ok(given)
    }

    /// How the network sees a state of `entries`.
    pub(super) fn normaliser(&self, entries: usize) -> Result<Normaliser, DescriptionError> {
        let std = list("state_std", &self.state_std, entries, 1.0)?;
        if let Some(at) = std.iter().position(|&std| !(std > 0.0 && std.is_finite())) {
            return Err(DescriptionError::Deviation(at));
        }
        let mean = list("state_mean", &self.state_mean, entries, 0.0)?;
        Ok(Normaliser { mean, factor: std.iter().map(|std| 1.0 / std).collect() })
    }

    /// Low, high and fallback of an action of `entries`, one after the other.
    pub(super) fn bounds(&self, entries: usize) -> Result<Vec<f32>, DescriptionError> {
        let low = list("action_low", &self.action_low, entries, -1.0)?;
        let high = list("action_high", &self.action_high, entries, 1.0)?;
        let fallback = list("action_fallback", &self.action_fallback, entries, 0.0)?;
        Ok([low, high, fallback].concat())
    }
}

fn list(
    key: &'static str,
    given: &Option<Vec<f32>>,
    expected: usize,
    default: f32,
) -> Result<Vec<f32>, DescriptionError> {
    match given {
        None => Ok(vec![default; expected]),
        Some(list) if list.len() == expected => Ok(list.clone()),
        Some(list) => Err(DescriptionError::Length { key, expected, found: list.len() }),
    }
}
