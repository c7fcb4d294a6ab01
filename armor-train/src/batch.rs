//! Transitions of a training step, as matrices whose columns are samples.

use nalgebra::DMatrix;

use crate::nn::Scalar;

/// A share of a batch: `B` transitions `(s, kappa, a, r, c, s', kappa')` of section 3.2.
#[derive(Clone, Debug)]
pub struct Batch<T: Scalar> {
    /// States, `S x B`, as the networks see them.
    pub state: DMatrix<T>,
    /// Actions, `A x B`.
    pub action: DMatrix<T>,
    /// Next states, `S x B`.
    pub next_state: DMatrix<T>,
    /// Rewards, scaled `[B]`.
    pub reward: Vec<T>,
    /// Costs, scaled `[B]`.
    pub cost: Vec<T>,
    /// Remaining budget in units of scaled cost `[B]`.
    pub kappa: Vec<T>,
    /// Remaining budget after the step `[B]`.
    pub next_kappa: Vec<T>,
    /// What the actor is conditioned on where it is cloned alone `[B]`; kappa, or a leniency.
    pub condition: Vec<T>,
    /// What `Q_cL` is held against, in units of scaled cost `[B]`; kappa in the paper.
    pub threshold: Vec<T>,
    /// 1 where the episode goes on after the step, 0 where it ends `[B]`.
    pub alive: Vec<T>,
    /// Weight `w` of Eq. 10 `[B]`.
    pub weight: Vec<T>,
}

impl<T: Scalar> Batch<T> {
    /// Room for `samples` transitions.
    pub fn zeros(state: usize, action: usize, samples: usize) -> Self {
        let row = || vec![T::zero(); samples];
        Self {
            state: DMatrix::zeros(state, samples),
            action: DMatrix::zeros(action, samples),
            next_state: DMatrix::zeros(state, samples),
            reward: row(),
            cost: row(),
            kappa: row(),
            next_kappa: row(),
            condition: row(),
            threshold: row(),
            alive: row(),
            weight: row(),
        }
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.reward.len()
    }
}
