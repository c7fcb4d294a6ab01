//! The parameters of a network as its passes read them.

use rayon::prelude::*;

use super::product::{Operand, Packed, Update, product_fetching};
use super::{Ahead, Linear, Scalar};

/// The passes that a copy of weights serves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passes {
    /// Forward passes alone.
    Forward,
    /// Forward and backward passes.
    Both,
}

/// Parameters with copies of some layers' weights, in the order in which products read them;
/// made once for all shares of a batch.
#[derive(Debug)]
pub struct Panels<'a, T> {
    parameters: &'a [T],
    /// Ascending by offset.
    layers: Vec<LayerPanels<T>>,
}

/// The weights of a layer.
#[derive(Debug)]
struct LayerPanels<T> {
    /// Index of the layer's first weight among the parameters.
    offset: usize,
    weights: Packed<T>,
    /// Where a backward pass may follow.
    transposed: Option<Packed<T>>,
}

impl<'a, T: Scalar> Panels<'a, T> {
    /// Copies the weights of `layers`, which ascend by offset, for `passes`.
    pub fn new<'l>(layers: impl Iterator<Item = &'l Linear>, parameters: &'a [T], passes: Passes) -> Self {
        let layers: Vec<&Linear> = layers.collect();
        let copy = |layer: &&Linear| {
            let weights = layer.weights(parameters);
            let transposed = (passes == Passes::Both).then(|| Packed::new(weights.transposed()));
            LayerPanels { offset: layer.offset, weights: Packed::new(weights), transposed }
        };
        Self { parameters, layers: layers.par_iter().map(copy).collect() }
    }
}

/// Parameters to be read, the copies of weights that there are, and what may be fetched during products with them.
#[derive(Debug)]
pub struct Weights<'a, T> {
    parameters: &'a [T],
    layers: &'a [LayerPanels<T>],
    ahead: &'a Ahead,
}

impl<T> Clone for Weights<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Weights<'_, T> {}

impl<'a, T> From<&'a [T]> for Weights<'a, T> {
    fn from(parameters: &'a [T]) -> Self {
        Self { parameters, layers: &[], ahead: Ahead::nothing() }
    }
}

impl<'a, T> From<&'a Vec<T>> for Weights<'a, T> {
    fn from(parameters: &'a Vec<T>) -> Self {
        parameters.as_slice().into()
    }
}

impl<'a, T> From<&'a Panels<'_, T>> for Weights<'a, T> {
    fn from(panels: &'a Panels<'_, T>) -> Self {
        Self { parameters: panels.parameters, layers: &panels.layers, ahead: Ahead::nothing() }
    }
}

impl<'a, T: Scalar> Weights<'a, T> {
    /// The same weights, whose products fetch what is `ahead`.
    pub const fn fetching<'b>(self, ahead: &'b Ahead) -> Weights<'b, T>
    where
        'a: 'b,
    {
        Weights { parameters: self.parameters, layers: self.layers, ahead }
    }

    /// All parameters of the network.
    pub const fn parameters(self) -> &'a [T] {
        self.parameters
    }

    /// Writes `W input` to `out`, column by column.
    pub(super) fn multiply(self, layer: &Linear, out: &mut [T], input: Operand<'_, T>, update: Update<'_, T>) {
        match self.panels(layer) {
            Some(panels) => panels.weights.multiply(out, input, update, self.ahead),
            None => product_fetching(out, layer.weights(self.parameters), input, update, self.ahead),
        }
    }

    /// Writes `W^T delta` to `out`, column by column.
    pub(super) fn multiply_transposed(
        self,
        layer: &Linear,
        out: &mut [T],
        delta: Operand<'_, T>,
        update: Update<'_, T>,
    ) {
        match self.panels(layer).and_then(|panels| panels.transposed.as_ref()) {
            Some(transposed) => transposed.multiply(out, delta, update, self.ahead),
            None => {
                let transposed = layer.weights(self.parameters).transposed();
                product_fetching(out, transposed, delta, update, self.ahead);
            }
        }
    }

    fn panels(self, layer: &Linear) -> Option<&'a LayerPanels<T>> {
        let place = self.layers.binary_search_by_key(&layer.offset, |panels| panels.offset).ok()?;
        Some(&self.layers[place])
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;
    use crate::nn::{Activation, Mlp};
    use crate::testing::fill;

    /// Whole and partial panels, and copies of the forward pass alone.
    #[test]
    fn a_pass_with_copies_has_the_bits_of_one_without() {
        let mlp = Mlp::new(&[7, 33, 16, 2], 0, Activation::Mish, None);
        let draws = |len, stream| fill(len, stream).into_iter().map(|draw| draw as f32).collect::<Vec<_>>();
        let (parameters, input) = (draws(mlp.end(), 1), DMatrix::from_vec(7, 13, draws(7 * 13, 2)));
        let pass = |weights: Weights<'_, f32>| {
            let mut tape = mlp.tape(13);
            mlp.forward(weights, &input, &mut tape, true);
            let output = tape.output().clone();
            tape.output_gradient().copy_from(&output);
            let (mut gradient, mut below) = (vec![0.0; mlp.end()], DMatrix::zeros(7, 13));
            mlp.backward(weights, &input, &mut tape, Some(&mut gradient), Some((&mut below, Update::Replace)));
            [output.as_slice(), &gradient, below.as_slice()].concat().into_iter().map(f32::to_bits).collect::<Vec<_>>()
        };
        let plain = pass((&parameters).into());
        for passes in [Passes::Forward, Passes::Both] {
            let panels = Panels::new(mlp.layers().iter(), &parameters, passes);
            assert_eq!(pass((&panels).into()), plain, "{passes:?}");
        }
    }
}
