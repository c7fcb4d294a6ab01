//! Where a run comes from: what its folder must say so that it can be repeated.

use std::path::Path;

use firmware_sim::file;
use serde::{Deserialize, Serialize};

use super::RunError;
use crate::config::Config;
use crate::data::{Dataset, ToGo};

/// Origin of a run; `provenance.json` in its folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Version of the program that wrote it last.
    pub version: String,
    /// The commit it was built from, or `unknown`; "with changes" where files were not as committed.
    pub commit: String,
    /// SHA-256 of the recorded data, in hexadecimal.
    pub data_sha256: String,
    /// Seed of everything random.
    pub seed: u64,
    /// Transitions of the data.
    pub transitions: usize,
    /// Trajectories of the data.
    pub trajectories: usize,
    /// Entries of a state.
    pub state_entries: usize,
    /// Entries of an action.
    pub action_entries: usize,
    /// The largest cost return of the data, unscaled.
    pub max_kappa: f64,
    /// Sums of scaled reward to go, discounted as `Q_r`.
    pub reward_to_go: ToGo,
    /// Sums of scaled cost to go, discounted as `Q_cL`.
    pub cost_to_go: ToGo,
}

impl Provenance {
    /// Name of the file within a run's folder.
    pub const FILE: &str = "provenance.json";

    /// The origin of a run of `config` on `data`.
    pub fn new(config: &Config, data: &Dataset) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: env!("ARMOR_COMMIT").to_owned(),
            data_sha256: data.sha256().iter().map(|byte| format!("{byte:02x}")).collect(),
            seed: config.seed,
            transitions: data.len(),
            trajectories: data.trajectories().len(),
            state_entries: data.state_dim(),
            action_entries: data.action_dim(),
            max_kappa: f64::from(data.max_kappa()),
            reward_to_go: ToGo::new(data, config.reward_discount, |row| {
                f64::from(data.reward(row)) * config.reward_scale
            }),
            cost_to_go: ToGo::new(data, config.long_cost_discount, |row| f64::from(data.cost(row)) * config.cost_scale),
        }
    }

    pub(super) fn write(&self, folder: &Path) -> Result<(), RunError> {
        // Names and finite numbers: nothing in it that JSON could not say.
        let text = serde_json::to_string_pretty(self).unwrap_or_default() + "\n";
        Ok(file::write(&folder.join(Self::FILE), text.as_bytes())?)
    }
}
