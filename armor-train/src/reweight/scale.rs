//! Which scales of reweighting are on (section 4.5).

use serde::{Deserialize, Serialize};

/// The scales that the weights of section 3.3 have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scales {
    /// Trajectories and transitions (the paper).
    Both,
    /// Trajectories alone (Eq. 6).
    Trajectory,
    /// Transitions alone (Eqs. 8 and 9).
    Counterfactual,
    /// None: every weight is 1 ("w/o Reweighting").
    Off,
}

impl Scales {
    /// Whether trajectories are weighted.
    pub const fn trajectory(self) -> bool {
        matches!(self, Self::Both | Self::Trajectory)
    }

    /// Whether transitions are weighted.
    pub const fn counterfactual(self) -> bool {
        matches!(self, Self::Both | Self::Counterfactual)
    }
}

/// Over what the margins of Eq. 9 have their mean (O-22).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MarginMean {
    /// A mini-batch (the paper).
    Batch,
    /// All transitions of the refresh.
    Data,
}

/// Over what the weights of Eq. 10 have their mean before they are clipped (O-22).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WeightMean {
    /// All transitions (the paper preset; the paper leaves it open).
    Data,
    /// The batch of a training step.
    Batch,
}

/// What the moving average over refreshes is of (O-21).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Averaged {
    /// `w_cf` (the paper's ablation says so).
    Counterfactual,
    /// The final weight `w`.
    Weight,
}
