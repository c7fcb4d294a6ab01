//! What the critics' targets bootstrap from, and a share's work where it is the sample itself.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::value::{StateValue, StateValueTape};
use super::{CriticTape, Task};
use crate::batch::Batch;
use crate::nn::{Scalar, Weights};

/// What the critics' targets bootstrap from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Bootstrap {
    /// The target critic at an action of the policy (Eq. 3, the paper).
    Policy,
    /// State values that were learnt at recorded actions alone ([`StateValue`]).
    InSample,
}

/// Room for the state values of a share of the batch.
#[derive(Clone, Debug)]
pub struct InSample<T: Scalar> {
    here: StateValueTape<T>,
    next: StateValueTape<T>,
    /// Gradient of the share's expectile losses.
    pub(crate) gradient: Vec<T>,
    /// Summed expectile losses of the share.
    pub(crate) losses: [f64; 3],
}

impl<T: Scalar> InSample<T> {
    /// Room for `samples` columns.
    pub fn new(value: &StateValue, samples: usize) -> Self {
        Self {
            here: value.tape(samples),
            next: value.tape(samples),
            gradient: vec![T::zero(); value.size()],
            losses: [0.0; 3],
        }
    }

    /// Computes losses and gradient of the state values towards the target critic, whose last
    /// forward pass was at the recorded actions, and the values of the next states.
    ///
    /// Means are over `batch_len` samples, of which `batch` is a share.
    pub fn regress(
        &mut self,
        (value, weights): (&StateValue, Weights<'_, T>),
        (batch, batch_len): (&Batch<T>, usize),
        target: &CriticTape<T>,
    ) {
        let at = |state: &DMatrix<T>, kappa: &[T], tape: &mut StateValueTape<T>, slopes| {
            value.forward(weights, &Task::ALL, (state, kappa), tape, slopes);
        };
        at(&batch.state, &batch.kappa, &mut self.here, true);
        self.gradient.fill(T::zero());
        for (loss, task) in self.losses.iter_mut().zip(Task::ALL) {
            let at_recorded = target.pessimistic(task);
            *loss = value.backward(weights, task, at_recorded, batch_len, &mut self.here, &mut self.gradient);
        }
        at(&batch.next_state, &batch.next_kappa, &mut self.next, false);
    }

    /// `V_f(s', kappa')`.
    pub fn next_values(&self, task: Task) -> impl Iterator<Item = T> {
        self.next.values(task)
    }
}
