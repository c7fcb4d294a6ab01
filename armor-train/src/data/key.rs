//! The seven data sets of the DSRL layout.

use std::fmt;

use armor_core::shape::Shape;
use serde::Serialize;

/// A data set in the root of a DSRL file; one row is one transition.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Key {
    /// States, `(N, S)`.
    Observations,
    /// States after the action, `(N, S)`.
    NextObservations,
    /// Actions in `[-1, 1]`, `(N, A)`.
    Actions,
    /// Rewards, `(N)`.
    Rewards,
    /// Costs of at least 0, `(N)`.
    Costs,
    /// Whether the episode ended by the task's own rule, `(N)`.
    Terminals,
    /// Whether the episode ended by its time limit, `(N)`.
    Timeouts,
}

impl Key {
    /// Every data set, in the order of the variants.
    pub const ALL: [Self; 7] = [
        Self::Observations,
        Self::NextObservations,
        Self::Actions,
        Self::Rewards,
        Self::Costs,
        Self::Terminals,
        Self::Timeouts,
    ];

    /// The name in the file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Observations => "observations",
            Self::NextObservations => "next_observations",
            Self::Actions => "actions",
            Self::Rewards => "rewards",
            Self::Costs => "costs",
            Self::Terminals => "terminals",
            Self::Timeouts => "timeouts",
        }
    }

    /// Whether rows of this width can be trained on: what no policy image can hold, nothing can fly.
    pub(super) fn accepts_width(self, width: u64) -> bool {
        const ONE: Shape = Shape { state: 1, action: 1, hidden: 1, kappa_hidden: 1, kappa_embedding: 1, steps: 1 };
        let Ok(width) = u16::try_from(width) else {
            return false;
        };
        match self {
            Self::Observations | Self::NextObservations => Shape { state: width, ..ONE }.is_valid(),
            Self::Actions => Shape { action: width, ..ONE }.is_valid(),
            _ => width == 1,
        }
    }

    /// Whether a row is a vector, and the data set two-dimensional.
    pub(super) const fn is_vector(self) -> bool {
        matches!(self, Self::Observations | Self::NextObservations | Self::Actions)
    }

    /// Whether the values are flags.
    pub(super) const fn is_flag(self) -> bool {
        matches!(self, Self::Terminals | Self::Timeouts)
    }

    /// The shape to write, in words.
    pub(super) const fn shape(self) -> &'static str {
        if self.is_vector() { "(N, width), the width from 1 to what a policy image can hold" } else { "(N) or (N, 1)" }
    }

    /// The types to write, in words.
    pub(super) const fn types(self) -> &'static str {
        if self.is_flag() { "bool, u8, i8, f32 or f64" } else { "f32 or f64" }
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
