//! What a forward pass leaves behind for the backward pass.

use nalgebra::DMatrix;

use super::{Operand, Scalar};

/// Values and slopes of a stack of layers, and their gradients; reused from step to step.
#[derive(Clone, Debug)]
pub struct Tape<T: Scalar> {
    /// Output of each layer.
    pub(super) values: Vec<DMatrix<T>>,
    /// Derivative of each layer's activation.
    pub(super) slopes: Vec<DMatrix<T>>,
    /// Gradient with respect to the output.
    pub(super) output_gradient: DMatrix<T>,
    /// Gradient with respect to the sum of each layer before the last; none where it is written over the slopes.
    pub(super) deltas: Vec<DMatrix<T>>,
    /// Columns of the above that hold samples.
    pub(super) columns: usize,
    /// Whether the slopes are those of the last forward pass.
    pub(super) has_slopes: bool,
}

impl<T: Scalar> Tape<T> {
    /// The same room, and more: any number of backward passes may follow a forward pass, not only one.
    pub fn repeatable(mut self) -> Self {
        self.deltas = self.slopes[..self.slopes.len() - 1].to_vec();
        self
    }

    /// The output of the last forward pass, `outputs x samples`.
    pub fn output(&self) -> &DMatrix<T> {
        self.values.last().expect("an Mlp has a layer")
    }

    /// Where the gradient with respect to the output is written before a backward pass.
    pub fn output_gradient(&mut self) -> &mut DMatrix<T> {
        &mut self.output_gradient
    }

    /// [`Tape::output`] and [`Tape::output_gradient`].
    pub fn output_with_gradient(&mut self) -> (&DMatrix<T>, &mut DMatrix<T>) {
        (self.values.last().expect("an Mlp has a layer"), &mut self.output_gradient)
    }

    /// Output and slopes of each layer before the last.
    pub(crate) fn layers(&self) -> impl DoubleEndedIterator<Item = [&DMatrix<T>; 2]> {
        let inner = ..self.values.len() - 1;
        self.values[inner].iter().zip(&self.slopes[inner]).map(|(values, slopes)| [values, slopes])
    }

    /// The input of a layer, given by its index, and after a backward pass the gradient with respect to its sum.
    pub(crate) fn around<'a>(&'a self, layer: usize, input: &'a DMatrix<T>) -> [Operand<'a, T>; 2] {
        let deltas = if self.deltas.is_empty() { &self.slopes } else { &self.deltas };
        let delta = if layer + 1 == self.values.len() { &self.output_gradient } else { &deltas[layer] };
        let input = if layer == 0 { input } else { &self.values[layer - 1] };
        [input, delta].map(|matrix| Operand::leading(matrix, self.columns))
    }

    /// Keeps these samples (ascending) for the backward pass, in the leading columns, and forgets the others.
    pub fn keep(&mut self, samples: &[usize]) {
        self.values.iter_mut().chain(&mut self.slopes).for_each(|matrix| keep_columns(matrix, samples));
        self.columns = samples.len();
    }
}

/// Moves the given columns (ascending) to the front.
pub fn keep_columns<T: Scalar>(matrix: &mut DMatrix<T>, columns: &[usize]) {
    let rows = matrix.nrows();
    for (to, &from) in columns.iter().enumerate().filter(|&(to, &from)| to != from) {
        matrix.as_mut_slice().copy_within(from * rows..(from + 1) * rows, to * rows);
    }
}
