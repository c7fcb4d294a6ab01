//! A fully connected layer as a view into a parameter vector.

use std::ops::Range;

use super::product::{Operand, Update, product, product_fetching};
use super::{Ahead, Scalar};

/// Where a layer lies in the parameters of its network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Linear {
    /// Entries of its input.
    pub inputs: usize,
    /// Entries of its output.
    pub outputs: usize,
    /// Index of its first weight.
    pub offset: usize,
}

impl Linear {
    /// Numbers of the layer: weights, then bias.
    pub const fn size(&self) -> usize {
        self.inputs * self.outputs + self.outputs
    }

    /// Index one past the layer's last number.
    pub const fn end(&self) -> usize {
        self.offset + self.size()
    }

    /// Weights, `outputs x inputs`.
    pub fn weights<'a, T: Scalar>(&self, parameters: &'a [T]) -> Operand<'a, T> {
        self.block(parameters, 0..self.inputs)
    }

    /// The weights of some of the inputs, `outputs x range`.
    pub fn block<'a, T: Scalar>(&self, parameters: &'a [T], inputs: Range<usize>) -> Operand<'a, T> {
        let columns = inputs.len();
        Operand::new(&parameters[self.range(inputs)], self.outputs, columns)
    }

    /// Where the weights of some of the inputs lie.
    const fn range(&self, inputs: Range<usize>) -> Range<usize> {
        self.offset + inputs.start * self.outputs..self.offset + inputs.end * self.outputs
    }

    /// Bias `[outputs]`.
    pub fn bias<'a, T: Scalar>(&self, parameters: &'a [T]) -> &'a [T] {
        &parameters[self.end() - self.outputs..self.end()]
    }

    /// As [`Linear::bias`], to write a gradient.
    pub fn bias_mut<'a, T: Scalar>(&self, parameters: &'a mut [T]) -> &'a mut [T] {
        &mut parameters[self.end() - self.outputs..self.end()]
    }

    /// Adds the gradient of weights and bias: `delta x^T` and the row sums of `delta`; meanwhile may fetch what is `ahead`.
    pub fn add_gradient<T: Scalar>(
        &self,
        gradient: &mut [T],
        delta: Operand<'_, T>,
        input: Operand<'_, T>,
        ahead: &Ahead,
    ) {
        let weights = &mut gradient[self.range(0..self.inputs)];
        product_fetching(weights, delta, input.transposed(), Update::Add, ahead);
        self.add_bias_gradient(gradient, delta);
    }

    /// Adds the gradient of the weights of some of the inputs: `delta x^T`.
    pub fn add_block_gradient<T: Scalar>(
        &self,
        gradient: &mut [T],
        inputs: Range<usize>,
        delta: Operand<'_, T>,
        input: Operand<'_, T>,
    ) {
        let block = &mut gradient[self.range(inputs)];
        product(block, delta, input.transposed(), Update::Add);
    }

    /// Adds the gradient of the bias: the row sums of `delta`.
    pub fn add_bias_gradient<T: Scalar>(&self, gradient: &mut [T], delta: Operand<'_, T>) {
        let bias = self.bias_mut(gradient);
        for column in delta.stored_columns() {
            for (sum, &delta) in bias.iter_mut().zip(column) {
                *sum += delta;
            }
        }
    }
}
