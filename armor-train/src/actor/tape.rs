//! What an update of the actor leaves behind for its gradient.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::chain::Chain;
use super::denoiser::{Call, Context};
use crate::critic::{CriticTape, Pick, Task};
use crate::dual::DualTape;
use crate::nn::Scalar;
use crate::pool::Pool;

/// What an update of the actor and the dual needs, for a share of the batch.
#[derive(Clone, Debug)]
pub struct ActorTape<T: Scalar> {
    pub(super) context: Context<T>,
    pub(super) call: Call<T>,
    /// Lent from the forward to the backward pass.
    pub(super) chain: Option<Chain<T>>,
    pub(super) chains: Arc<Pool<Chain<T>>>,
    /// Whether the one-step estimate lay within the bounds, `A x B`.
    pub(super) inside: DMatrix<T>,
    pub(super) critic: CriticTape<T>,
    pub(super) pick: Pick,
    pub(super) dual: DualTape<T>,
    /// The policy's actions `a_pi`, `A x B`.
    pub action: DMatrix<T>,
    /// `Q_cL - threshold` at `a_pi`, scaled `[B]`; the paper's threshold is kappa.
    pub violation: Vec<T>,
    pub(super) action_gradient: DMatrix<T>,
}

impl<T: Scalar> ActorTape<T> {
    /// `Q_r` or `Q_cL` at the policy's actions.
    pub(crate) fn values(&self, task: Task) -> impl Iterator<Item = T> {
        self.critic.values(task, self.pick)
    }
}
