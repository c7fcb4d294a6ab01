//! What a pass of the critic leaves behind.

use nalgebra::DMatrix;

use super::{CriticOptions, Pick, Task};
use crate::nn::{Scalar, Tape};

/// What a forward pass leaves behind; reused from step to step.
#[derive(Clone, Debug)]
pub struct CriticTape<T: Scalar> {
    pub(super) options: CriticOptions,
    pub(super) input: DMatrix<T>,
    pub(super) trunks: Vec<Tape<T>>,
    pub(super) heads: Vec<[Tape<T>; 2]>,
    /// Gradient with respect to the input.
    pub(super) input_gradient: DMatrix<T>,
}

impl<T: Scalar> CriticTape<T> {
    /// The pessimistic twin of a task from the last forward pass: the minimum
    /// of rewards, the maximum of costs.
    pub fn pessimistic(&self, task: Task) -> impl Iterator<Item = T> {
        self.values(task, Pick::PESSIMISTIC)
    }

    /// What `pick` makes of the twins of a task from the last forward pass.
    pub fn values(&self, task: Task, pick: Pick) -> impl Iterator<Item = T> {
        let [one, two] = &self.heads[self.options.head_of(task)];
        let twins = one.output().iter().zip(two.output().iter());
        twins.map(move |(&one, &two)| pick.value(task, [one, two]))
    }
}
