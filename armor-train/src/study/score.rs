//! What a run of a study scored, kept in its folder.

use std::path::Path;

use firmware_sim::file::{self, FileError};
use firmware_sim::summary::FlightSummary;
use serde::{Deserialize, Serialize};

use crate::config::{Config, Preset};

/// Scores of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// What was trained and flown, to know whether the score is still that of the study.
    pub of: String,
    /// A flight for each of the study's `max_steps`.
    pub flights: Vec<Flown>,
    /// The study's columns, from the last row of `metrics.csv`.
    pub columns: Vec<f64>,
}

/// A flight of a run's policy.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Flown {
    /// Calls of the denoiser that an action could take.
    pub max_steps: usize,
    /// Mean normalised reward (Eq. 17).
    pub reward_normalized: f64,
    /// Mean normalised cost; at most 1 is safe.
    pub cost_normalized: f64,
}

impl Flown {
    /// The scores of a flight.
    pub const fn new(max_steps: usize, summary: &FlightSummary) -> Self {
        let FlightSummary { reward_normalized, cost_normalized, .. } = *summary;
        Self { max_steps, reward_normalized, cost_normalized }
    }
}

impl Score {
    /// Name of the file within a run's folder.
    pub const FILE: &str = "score.json";

    /// What a score is of: configuration, data, and how it was flown.
    pub fn of(config: &Config, data_sha256: &[u8; 32], flights: &str) -> String {
        let data: String = data_sha256.iter().map(|byte| format!("{byte:02x}")).collect();
        format!("{}data_sha256 = {data}\nflights = {flights}\n", config.options())
    }

    /// The score in a run's folder, if there is one of this study.
    pub fn read(folder: &Path, of: &str) -> Option<Self> {
        let bytes = file::read(&folder.join(Self::FILE)).ok()?;
        serde_json::from_slice(&bytes).ok().filter(|score: &Self| is_same(&score.of, of))
    }

    /// Writes the score, whole or not at all.
    ///
    /// # Errors
    /// [`FileError`]
    pub fn write(&self, folder: &Path) -> Result<(), FileError> {
        let text = serde_json::to_string_pretty(self).unwrap_or_default();
        file::write(&folder.join(Self::FILE), text.as_bytes())
    }
}

/// Whether a score of `before` is one of `now`: every line is the same, but for options that
/// did not exist then and are off, as in the preset `paper`.
fn is_same(before: &str, now: &str) -> bool {
    let off = Preset::Paper.config("", 0.0).options().to_string();
    let is_in = |text: &str, line: &str| text.lines().any(|other| other == line);
    let key = |line: &str| line.split(" = ").next().unwrap_or_default().to_owned();
    let is_new = |line: &str| before.lines().all(|other| key(other) != key(line));
    before.lines().all(|line| is_in(now, line))
        && now.lines().all(|line| is_in(before, line) || is_new(line) && is_in(&off, line))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_score_counts_for_what_it_is_of_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let config = Preset::Quick.config("ball-run", 5.0);
        let of = Score::of(&config, &[7; 32], "20 episodes");
        let flown = Flown { max_steps: 5, reward_normalized: 0.25, cost_normalized: 0.1 };
        let score = Score { of: of.clone(), flights: vec![flown], columns: vec![0.5] };
        score.write(folder.path()).unwrap();
        assert_eq!(Score::read(folder.path(), &of), Some(score));
        let others = [
            Score::of(&Config { eta: 0.5, ..config.clone() }, &[7; 32], "20 episodes"),
            Score::of(&config, &[8; 32], "20 episodes"),
            Score::of(&config, &[7; 32], "10 episodes"),
        ];
        assert!(others.iter().all(|other| Score::read(folder.path(), other).is_none()));
    }

    #[test]
    fn a_score_outlives_an_option_that_is_new_and_off() {
        let config = Preset::Quick.config("ball-run", 5.0);
        let now = Score::of(&config, &[7; 32], "20 episodes");
        let without = |key: &str| {
            let kept = now.lines().filter(|line| !line.starts_with(&format!("{key} = ")));
            kept.map(|line| format!("{line}\n")).collect::<String>()
        };
        assert!(is_same(&now, &now) && is_same(&without("weight_decay"), &now));
        // In `quick` this one is on, so whoever did not know it trained something else.
        assert!(!is_same(&without("actor_average"), &now));
        assert!(!is_same(&now, &without("weight_decay")));
    }
}
