//! How much the reward critic guides the actor (Eq. 14).

use serde::{Deserialize, Serialize};

/// The scale of `Q_r` in the actor's loss (O-14).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Guidance {
    /// `Q_r` as it is (the paper).
    Raw,
    /// `Q_r` divided by its mean size over the batch, held fixed (Fujimoto and Gu
    /// 2021), so that one eta means the same on tasks with other returns.
    Normalized,
}

/// A mean size below this has no scale to divide by.
const NO_SCALE: f64 = 1e-6;

impl Guidance {
    /// The factor on `Q_r`, where it does not depend on the batch.
    pub const fn constant(self, eta: f64) -> Option<f64> {
        match self {
            Self::Raw => Some(eta),
            Self::Normalized => None,
        }
    }

    /// The factor on `Q_r` that stands for `eta`, where that depends on `mean |Q_r| = size` of the batch.
    pub fn normalized(eta: f64, size: f64) -> f64 {
        eta / size.max(NO_SCALE)
    }
}

/// How the squared error of a noise prediction is summed over action entries (Eq. 13, O-12).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CloningNorm {
    /// The squared norm (the paper).
    Sum,
    /// The mean over entries, which weakens cloning against guidance by their number.
    Mean,
}

impl CloningNorm {
    /// The factor on the squared norm of an error with `entries` entries.
    pub fn factor(self, entries: usize) -> f64 {
        match self {
            Self::Sum => 1.0,
            Self::Mean => 1.0 / entries as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normalised_guidance_is_the_same_for_all_scales_of_reward() {
        for size in [0.01, 1.0, 300.0] {
            assert!((Guidance::normalized(0.7, size) * size - 0.7).abs() < 1e-12);
        }
        assert!(Guidance::normalized(0.7, 0.0).is_finite());
    }
}
