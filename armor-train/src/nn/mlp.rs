//! A stack of fully connected layers, forward and backward.

use nalgebra::DMatrix;

use super::product::{Operand, Packed, Update, product};
use super::{Activation, Linear, Scalar, Tape};

/// Layout of a stack of layers within a parameter vector.
#[derive(Clone, Debug)]
pub struct Mlp {
    layers: Vec<Linear>,
    activation: Activation,
    /// What follows the last layer; nothing where its sums are the output.
    output: Option<Activation>,
}

impl Mlp {
    /// A stack through the given widths, its numbers from index `offset` on, with
    /// `activation` between layers and `output` behind the last.
    pub fn new(widths: &[usize], offset: usize, activation: Activation, output: Option<Activation>) -> Self {
        let mut layers: Vec<Linear> = Vec::new();
        for pair in widths.windows(2) {
            let offset = layers.last().map_or(offset, Linear::end);
            layers.push(Linear { inputs: pair[0], outputs: pair[1], offset });
        }
        Self { layers, activation, output }
    }

    /// The layers, first to last.
    pub fn layers(&self) -> &[Linear] {
        &self.layers
    }

    /// Index one past the last number.
    pub fn end(&self) -> usize {
        self.layers.last().map_or(0, Linear::end)
    }

    /// Room for passes over `samples` columns.
    pub fn tape<T: Scalar>(&self, samples: usize) -> Tape<T> {
        let room = || self.layers.iter().map(|layer| DMatrix::zeros(layer.outputs, samples)).collect();
        Tape { values: room(), slopes: room(), deltas: room(), columns: samples }
    }

    /// What follows a layer.
    fn activation(&self, layer: usize) -> Option<Activation> {
        if layer + 1 < self.layers.len() { Some(self.activation) } else { self.output }
    }

    /// The weights, for many forward passes with the same parameters; `packed` is what is replaced.
    pub fn pack<T: Scalar>(&self, parameters: &[T], packed: &mut Vec<Packed<T>>) {
        pack(self.layers.iter().map(|layer| layer.weights(parameters)), packed);
    }

    /// As [`Mlp::pack`], of the transposed weights, for backward passes.
    pub fn pack_transposed<T: Scalar>(&self, parameters: &[T], packed: &mut Vec<Packed<T>>) {
        pack(self.layers.iter().map(|layer| layer.weights(parameters).transposed()), packed);
    }

    /// Runs the stack on `input`, `inputs x samples`; with `slopes`, a backward pass may follow.
    pub fn forward<T: Scalar>(&self, parameters: &[T], input: &DMatrix<T>, tape: &mut Tape<T>, slopes: bool) {
        self.run(parameters, input, tape, slopes, |layer, out, input| {
            product(out, self.layers[layer].weights(parameters), input, Update::Replace);
        });
    }

    /// As [`Mlp::forward`], with the parameters' [`Mlp::pack`].
    pub fn forward_packed<T: Scalar>(
        &self,
        (parameters, weights): (&[T], &[Packed<T>]),
        input: &DMatrix<T>,
        tape: &mut Tape<T>,
        slopes: bool,
    ) {
        self.run(parameters, input, tape, slopes, |layer, out, input| {
            weights[layer].multiply(out, input, Update::Replace);
        });
    }

    /// A forward pass; `multiply` writes the product of a layer's weights and its input.
    fn run<T: Scalar>(
        &self,
        parameters: &[T],
        input: &DMatrix<T>,
        tape: &mut Tape<T>,
        slopes: bool,
        multiply: impl Fn(usize, &mut [T], Operand<'_, T>),
    ) {
        tape.columns = input.ncols();
        for (index, layer) in self.layers.iter().enumerate() {
            let (before, rest) = tape.values.split_at_mut(index);
            let input = before.last().unwrap_or(input);
            let values = &mut rest[0];
            multiply(index, values.as_mut_slice(), input.into());
            let bias = layer.bias(parameters);
            match self.activation(index) {
                Some(activation) => activation.apply(values, slopes.then_some(&mut tape.slopes[index]), bias),
                None => add_bias(values, bias),
            }
        }
    }

    /// Back-propagates [`Tape::output_gradient`] through the last forward pass.
    ///
    /// Adds to `gradient` (as long as the parameters) where it is given, and
    /// writes the gradient with respect to the input where `input_gradient` is given.
    /// After [`Tape::keep`] this holds for the leading columns of input and gradients alone.
    pub fn backward<T: Scalar>(
        &self,
        parameters: &[T],
        input: &DMatrix<T>,
        tape: &mut Tape<T>,
        gradient: Option<&mut [T]>,
        input_gradient: Option<&mut DMatrix<T>>,
    ) {
        let below = input_gradient.map(|gradient| (gradient.as_mut_slice(), Update::Replace));
        self.run_back(input, tape, gradient, below, |layer, out, delta, update| {
            product(out, self.layers[layer].weights(parameters).transposed(), delta, update);
        });
    }

    /// As [`Mlp::backward`], with the parameters' [`Mlp::pack_transposed`]; the gradient
    /// with respect to the input is multiplied by `slopes`, entry by entry.
    pub fn backward_packed<T: Scalar>(
        &self,
        transposes: &[Packed<T>],
        input: &DMatrix<T>,
        tape: &mut Tape<T>,
        gradient: &mut [T],
        (input_gradient, slopes): (&mut DMatrix<T>, &DMatrix<T>),
    ) {
        let below = (input_gradient.as_mut_slice(), Update::Times(slopes.as_slice()));
        self.run_back(input, tape, Some(gradient), Some(below), |layer, out, delta, update| {
            transposes[layer].multiply(out, delta, update);
        });
    }

    /// A backward pass; `multiply` writes the product of a layer's transposed weights and its delta.
    fn run_back<T: Scalar>(
        &self,
        input: &DMatrix<T>,
        tape: &mut Tape<T>,
        mut gradient: Option<&mut [T]>,
        mut input_gradient: Option<(&mut [T], Update<'_, T>)>,
        multiply: impl Fn(usize, &mut [T], Operand<'_, T>, Update<'_, T>),
    ) {
        let columns = tape.columns;
        if let (Some(_), Some(delta), Some(slopes)) = (self.output, tape.deltas.last_mut(), tape.slopes.last()) {
            scale(delta, slopes, columns);
        }
        for (index, layer) in self.layers.iter().enumerate().rev() {
            let (before, rest) = tape.deltas.split_at_mut(index);
            let delta = Operand::leading(&rest[0], columns);
            if let Some(gradient) = gradient.as_deref_mut() {
                let input = if index == 0 { input } else { &tape.values[index - 1] };
                layer.add_gradient(gradient, delta, Operand::leading(input, columns));
            }
            let below = match before.last_mut() {
                Some(below) => Some((below.as_mut_slice(), Update::Times(tape.slopes[index - 1].as_slice()))),
                None => input_gradient.take(),
            };
            if let Some((out, update)) = below {
                let len = layer.inputs * columns;
                multiply(index, &mut out[..len], delta, update.within(..len));
            }
        }
    }

    /// PyTorch's default: weights and biases uniform within `1 / sqrt(inputs)`, from draws in `[0, 1)`.
    pub fn initialise<T: Scalar>(&self, parameters: &mut [T], draws: &mut impl Iterator<Item = f64>) {
        for layer in &self.layers {
            layer.initialise(parameters, draws);
        }
    }
}

impl Linear {
    /// As [`Mlp::initialise`], for one layer.
    pub fn initialise<T: Scalar>(&self, parameters: &mut [T], draws: &mut impl Iterator<Item = f64>) {
        let bound = 1.0 / (self.inputs as f64).sqrt();
        for (parameter, draw) in parameters[self.offset..self.end()].iter_mut().zip(draws) {
            *parameter = T::of(bound * (2.0 * draw - 1.0));
        }
    }
}

/// Copies the matrices, into the memory of the copies before them where there are some.
fn pack<'a, T: Scalar>(matrices: impl Iterator<Item = Operand<'a, T>>, packed: &mut Vec<Packed<T>>) {
    for (index, matrix) in matrices.enumerate() {
        match packed.get_mut(index) {
            Some(packed) => packed.set(matrix),
            None => packed.push(Packed::new(matrix)),
        }
    }
}

/// Multiplies the first `columns` columns by `slopes`, entry by entry.
fn scale<T: Scalar>(delta: &mut DMatrix<T>, slopes: &DMatrix<T>, columns: usize) {
    let len = delta.nrows() * columns;
    for (delta, &slope) in delta.as_mut_slice()[..len].iter_mut().zip(slopes.as_slice()) {
        *delta *= slope;
    }
}

fn add_bias<T: Scalar>(values: &mut DMatrix<T>, bias: &[T]) {
    for column in values.as_mut_slice().chunks_exact_mut(bias.len()) {
        for (value, &bias) in column.iter_mut().zip(bias) {
            *value += bias;
        }
    }
}

#[cfg(test)]
mod tests;
