//! One call of the noise predictor, and what it leaves behind for its gradient.

use nalgebra::DMatrix;

use crate::nn::{Scalar, Tape, keep_columns};

/// One call of the network.
#[derive(Clone, Debug)]
pub struct Call<T: Scalar> {
    /// Noisy actions, `A x B`: the input.
    pub action: DMatrix<T>,
    /// Noise level of each sample, `1..=N`: the input.
    pub levels: Vec<usize>,
    /// Gradient with respect to the noisy actions, `A x B`, after a backward pass.
    pub action_gradient: DMatrix<T>,
    /// The samples that the leading columns belong to, ascending: all, or those kept for the backward pass.
    pub(super) kept: Vec<usize>,
    pub(super) hidden: DMatrix<T>,
    /// Derivative of the first layer's activation; after a backward pass, the gradient with respect to its sum.
    pub(super) hidden_slope: DMatrix<T>,
    pub(super) body: Tape<T>,
}

impl<T: Scalar> Call<T> {
    /// The predicted noise, `A x B`.
    pub fn noise(&self) -> &DMatrix<T> {
        self.body.output()
    }

    /// Where the gradient with respect to the predicted noise is written.
    pub fn noise_gradient(&mut self) -> &mut DMatrix<T> {
        self.body.output_gradient()
    }

    /// What a forward pass writes, in this order.
    pub(crate) fn written(&self) -> impl Iterator<Item = &[T]> {
        let inner = self.body.layers();
        [&self.hidden, &self.hidden_slope].into_iter().chain(inner.flatten()).map(DMatrix::as_slice)
    }

    /// What a backward pass to the inputs reads and writes, in this order.
    pub(crate) fn slopes(&self) -> impl Iterator<Item = &[T]> {
        let inner = self.body.layers().rev().map(|[_, slopes]| slopes);
        inner.chain([&self.hidden_slope]).map(|matrix| &matrix.as_slice()[..matrix.nrows() * self.kept.len()])
    }

    /// Keeps these samples (ascending) for the backward pass, whose gradients then
    /// stand in the leading columns; the noise gradient of the others is zero.
    pub fn keep(&mut self, samples: &[usize]) {
        keep_columns(&mut self.action, samples);
        keep_columns(&mut self.hidden, samples);
        keep_columns(&mut self.hidden_slope, samples);
        self.body.keep(samples);
        self.kept.clear();
        self.kept.extend_from_slice(samples);
    }

    /// The samples of the backward pass, column by column.
    pub fn kept(&self) -> &[usize] {
        &self.kept
    }
}
