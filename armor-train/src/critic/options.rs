//! Layouts of the critic: the paper's, its ablation's (section 4.5), and open choices.

use serde::{Deserialize, Serialize};

use super::Task;
use crate::nn::Activation;

/// What the estimates share.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Trunk {
    /// One trunk under all heads (the paper).
    Shared,
    /// Independent critics, each with a trunk of its own ("w/o multi-critic").
    Separate,
}

/// How many pairs of heads estimate costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CostHeads {
    /// One for each horizon (the paper).
    PerHorizon,
    /// One for both: it learns the targets of both horizons ("w/o multi-cost-critic").
    Single,
}

/// What follows the last layer of a cost head (O-7).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CostOutput {
    /// Nothing (the paper).
    Linear,
    /// Softplus: no estimate is negative, nor exactly 0.
    Softplus,
}

/// How the losses of twins are joined (Eq. 4, O-11).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TwinLoss {
    /// Their sum.
    Sum,
    /// Their mean.
    Mean,
}

impl TwinLoss {
    /// Factor of each twin's loss.
    pub(super) const fn share(self) -> f64 {
        match self {
            Self::Sum => 1.0,
            Self::Mean => 0.5,
        }
    }
}

/// Choices of the critic's layout and loss; the default is the paper's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CriticOptions {
    /// What the estimates share.
    pub trunk: Trunk,
    /// How many pairs of heads estimate costs.
    pub cost_heads: CostHeads,
    /// Hidden layers of a head (O-6).
    pub head_layers: usize,
    /// What follows the last layer of a cost head.
    pub cost_output: CostOutput,
    /// How the losses of twins are joined.
    pub twin_loss: TwinLoss,
}

impl Default for CriticOptions {
    fn default() -> Self {
        Self {
            trunk: Trunk::Shared,
            cost_heads: CostHeads::PerHorizon,
            head_layers: 1,
            cost_output: CostOutput::Linear,
            twin_loss: TwinLoss::Sum,
        }
    }
}

impl CriticOptions {
    /// Pairs of heads.
    pub(super) const fn heads(&self) -> usize {
        match self.cost_heads {
            CostHeads::PerHorizon => 3,
            CostHeads::Single => 2,
        }
    }

    /// Trunks.
    pub(super) const fn trunks(&self) -> usize {
        match self.trunk {
            Trunk::Shared => 1,
            Trunk::Separate => self.heads(),
        }
    }

    /// The pair of heads that estimates a task.
    pub(super) const fn head_of(&self, task: Task) -> usize {
        match (self.cost_heads, task) {
            (CostHeads::Single, Task::ShortCost) => Task::LongCost as usize,
            _ => task as usize,
        }
    }

    /// The trunk under those heads.
    pub(super) const fn trunk_of(&self, task: Task) -> usize {
        match self.trunk {
            Trunk::Shared => 0,
            Trunk::Separate => self.head_of(task),
        }
    }

    /// What follows the last layer of a pair of heads.
    pub(super) fn output(&self, pair: usize) -> Option<Activation> {
        let is_cost = pair != Task::Reward as usize;
        (is_cost && self.cost_output == CostOutput::Softplus).then_some(Activation::Softplus)
    }
}
