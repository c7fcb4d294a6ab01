//! A stack of fully connected layers, forward and backward.

use nalgebra::DMatrix;

use super::product::{Operand, Update};
use super::{Activation, Ahead, Linear, Scalar, Tape, Weights};

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
        let room = || self.layers.iter().map(|layer| DMatrix::zeros(layer.outputs, samples)).collect::<Vec<_>>();
        let (values, mut slopes) = (room(), room());
        let output_gradient = values.last().cloned().unwrap_or_default();
        if let (None, Some(last)) = (self.output, slopes.last_mut()) {
            *last = DMatrix::zeros(0, 0);
        }
        Tape { values, slopes, output_gradient, deltas: Vec::new(), columns: samples, has_slopes: false }
    }

    /// What follows a layer.
    fn activation(&self, layer: usize) -> Option<Activation> {
        if layer + 1 < self.layers.len() { Some(self.activation) } else { self.output }
    }

    /// Runs the stack on `input`, `inputs x samples`; with `slopes`, a backward pass may follow.
    pub fn forward<'a, T: Scalar>(
        &self,
        weights: impl Into<Weights<'a, T>>,
        input: &DMatrix<T>,
        tape: &mut Tape<T>,
        slopes: bool,
    ) {
        let weights = weights.into();
        (tape.columns, tape.has_slopes) = (input.ncols(), slopes);
        for (index, layer) in self.layers.iter().enumerate() {
            let (before, rest) = tape.values.split_at_mut(index);
            let input = before.last().unwrap_or(input);
            let values = rest[0].as_mut_slice();
            weights.multiply(layer, values, input.into(), Update::Replace);
            let bias = layer.bias(weights.parameters());
            match self.activation(index) {
                Some(activation) => activation.apply(values, slopes.then(|| tape.slopes[index].as_mut_slice()), bias),
                None => add_bias(values, bias),
            }
        }
    }

    /// Back-propagates [`Tape::output_gradient`] through the last forward pass, once unless
    /// the tape is [repeatable](Tape::repeatable).
    ///
    /// Adds to `gradient` (as long as the parameters) where it is given. Where `input_gradient`
    /// is given, the gradient with respect to the input updates it.
    /// After [`Tape::keep`] this holds for the leading columns of input and gradients alone.
    ///
    /// # Panics
    /// If the forward pass left no slopes, or an earlier backward pass wrote over them.
    pub fn backward<'a, T: Scalar>(
        &self,
        weights: impl Into<Weights<'a, T>>,
        input: &DMatrix<T>,
        tape: &mut Tape<T>,
        mut gradient: Option<&mut [T]>,
        mut input_gradient: Option<(&mut DMatrix<T>, Update<'_, T>)>,
    ) {
        let weights = weights.into();
        assert!(tape.has_slopes, "a backward pass needs slopes that no other one wrote over");
        tape.has_slopes = !tape.deltas.is_empty();
        let Tape { values, slopes, output_gradient, deltas, columns, .. } = tape;
        if let (Some(_), Some(slopes)) = (self.output, slopes.last()) {
            scale(output_gradient, slopes, *columns);
        }
        let (deltas, slopes) = if deltas.is_empty() { (slopes, None) } else { (deltas, Some(slopes)) };
        for (index, layer) in self.layers.iter().enumerate().rev() {
            let (before, rest) = deltas.split_at_mut(index);
            let delta = if index + 1 == self.layers.len() { &*output_gradient } else { &rest[0] };
            let delta = Operand::leading(delta, *columns);
            if let Some(gradient) = gradient.as_deref_mut() {
                let input = if index == 0 { input } else { &values[index - 1] };
                layer.add_gradient(gradient, delta, Operand::leading(input, *columns), Ahead::nothing());
            }
            let times_slope = || slopes.as_ref().map_or(Update::Multiply, |s| Update::Times(s[index - 1].as_slice()));
            let below = match before.last_mut() {
                Some(below) => Some((below, times_slope())),
                None => input_gradient.take(),
            };
            if let Some((out, update)) = below {
                let len = layer.inputs * *columns;
                weights.multiply_transposed(layer, &mut out.as_mut_slice()[..len], delta, update.within(..len));
            }
        }
    }

    /// Adds the gradient of a layer, given by its index, after a backward pass.
    pub fn add_layer_gradient<T: Scalar>(
        &self,
        index: usize,
        input: &DMatrix<T>,
        tape: &Tape<T>,
        gradient: &mut [T],
        ahead: &Ahead,
    ) {
        let [input, delta] = tape.around(index, input);
        self.layers[index].add_gradient(gradient, delta, input, ahead);
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

/// Multiplies the first `columns` columns by `slopes`, entry by entry.
fn scale<T: Scalar>(delta: &mut DMatrix<T>, slopes: &DMatrix<T>, columns: usize) {
    let len = delta.nrows() * columns;
    for (delta, &slope) in delta.as_mut_slice()[..len].iter_mut().zip(slopes.as_slice()) {
        *delta *= slope;
    }
}

fn add_bias<T: Scalar>(values: &mut [T], bias: &[T]) {
    for column in values.chunks_exact_mut(bias.len()) {
        for (value, &bias) in column.iter_mut().zip(bias) {
            *value += bias;
        }
    }
}

#[cfg(test)]
mod tests;
