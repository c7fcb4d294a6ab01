//! What a training run holds from step to step.

use serde::{Deserialize, Serialize};

use crate::model::{ActorCopy, Optimisers, Parameters};
use crate::nn::Scalar;
use crate::selection::Selection;

/// All that changes from step to step: what a checkpoint holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct LearnerState<T: Scalar> {
    /// Training steps done.
    pub step: u64,
    /// The networks.
    pub parameters: Parameters<T>,
    /// Their optimisers.
    pub optimisers: Optimisers<T>,
    /// `w_cf` of each transition, or `w` where that is averaged; all 1 before the first refresh.
    pub counterfactual: Vec<f32>,
    /// Share of the transitions that the last refresh raised.
    pub counterfactual_active: f64,
    /// The actor with the smallest cloning loss so far; none where the last one flies.
    pub selection: Selection<T>,
}

impl<T: Scalar> LearnerState<T> {
    /// The actor's weights that fly: those that were chosen, else their moving average, where one is kept.
    pub fn flying_actor(&self) -> &[T] {
        match &self.selection.actor[..] {
            [] => self.parameters.actor_copy(ActorCopy::Average),
            chosen => chosen,
        }
    }
}
