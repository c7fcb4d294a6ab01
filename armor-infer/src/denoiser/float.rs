//! The denoiser in single precision.
//!
//! Order of the sums, which fixes their bits: the context starts at the bias,
//! then come the state entries, then the kappa embedding; the first layer
//! starts at `T[n] + context`, then come the action entries; every other layer
//! starts at its bias.

use armor_core::image::FloatNetwork;
use armor_core::units::Cost;

use super::{affine, affine_columns, front, kappa_embedding, normalised};
use crate::policy::Policy;

/// The working memory of a denoiser for `K` noisy actions at a time.
pub(crate) struct FloatDenoiser<const STATE: usize, const HIDDEN: usize, const K: usize> {
    /// The normalised state `[S]`.
    pub(crate) state: [f32; STATE],
    /// `W_s s + W_k e(kappa) + b` of layer 1 `[H]`.
    pub(crate) context: [f32; HIDDEN],
    /// Outputs of layers 1 and 3 `[H]`.
    pub(crate) odd: [[f32; K]; HIDDEN],
    /// Outputs of layer 2 `[H]`.
    pub(crate) even: [[f32; K]; HIDDEN],
}

impl<const STATE: usize, const HIDDEN: usize, const K: usize> FloatDenoiser<STATE, HIDDEN, K> {
    pub(super) const fn new() -> Self {
        Self { state: [0.0; STATE], context: [0.0; HIDDEN], odd: [[0.0; K]; HIDDEN], even: [[0.0; K]; HIDDEN] }
    }

    pub(super) fn prepare(&mut self, policy: &Policy<'_>, network: &FloatNetwork<'_>, state: &[f32], kappa: Cost) {
        let entries = front(&mut self.state, policy.shape.state.into());
        for (out, value) in entries.iter_mut().zip(normalised(policy, state)) {
            *out = value;
        }
        let (first, second) = (self.odd.as_flattened_mut(), self.even.as_flattened_mut());
        let embedding = kappa_embedding(policy, kappa, first, second);
        let context = front(&mut self.context, policy.shape.hidden.into());
        affine(policy.kernel, &network.context_state, entries, context);
        policy.kernel.accumulate(network.context_kappa, embedding, context);
    }

    pub(super) fn eps(
        &mut self,
        policy: &Policy<'_>,
        network: &FloatNetwork<'_>,
        n: usize,
        action: &[[f32; K]],
        eps: &mut [[f32; K]],
    ) {
        let (kernel, h) = (policy.kernel, usize::from(policy.shape.hidden));
        let odd = front(&mut self.odd, h);
        let even = front(&mut self.even, h);

        let time = network.time_table.get(n.saturating_sub(1) * h..).unwrap_or_default();
        for ((out, time), context) in odd.iter_mut().zip(time).zip(&self.context) {
            *out = [time + context; K];
        }
        kernel.accumulate_columns(network.action_input, action, odd);
        kernel.mish(odd.as_flattened_mut());
        affine_columns(kernel, &network.hidden_2, odd, even);
        kernel.mish(even.as_flattened_mut());
        affine_columns(kernel, &network.hidden_3, even, odd);
        kernel.mish(odd.as_flattened_mut());
        affine_columns(kernel, &network.output, odd, eps);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::denoiser::Denoiser;
    use crate::fixture::{self, Fixture, PAPER};
    use armor_core::image::{Network, Sections};
    use armor_core::noise::Noise;
    use armor_core::shape::Shape;
    use std::vec;
    use std::vec::Vec;

    fn mish(x: f64) -> f64 {
        x * x.exp().ln_1p().tanh()
    }

    /// `bias + W x` in f64, for a matrix stored input by input.
    fn affine(weights: &[f32], bias: &[f32], x: &[f64]) -> Vec<f64> {
        let outputs = bias.len();
        let sum = |o: usize| x.iter().enumerate().map(|(i, x)| x * f64::from(weights[i * outputs + o])).sum::<f64>();
        (0..outputs).map(|o| f64::from(bias[o]) + sum(o)).collect()
    }

    fn activated(values: Vec<f64>) -> Vec<f64> {
        values.into_iter().map(mish).collect()
    }

    /// The denoiser as the paper writes it: one concatenated input, nothing hoisted, f64.
    fn reference(
        numbers: &Sections<'_>,
        shape: &Shape,
        scaled: f64,
        state: &[f32],
        action: &[f32],
        n: usize,
    ) -> Vec<f64> {
        let Network::Float(network) = &numbers.network else { panic!("the fixture is in single precision") };
        let [one, two, three] = &numbers.kappa;
        let hidden = activated(affine(one.weights, one.bias, &[scaled]));
        let hidden = activated(affine(two.weights, two.bias, &hidden));
        let embedding = affine(three.weights, three.bias, &hidden);

        let mut time = vec![0.0; usize::from(shape.steps)];
        time[n - 1] = 1.0;
        let normalised =
            (0..state.len()).map(|i| f64::from(state[i] - numbers.state_mean[i]) * f64::from(numbers.state_factor[i]));
        let input: Vec<f64> =
            action.iter().map(|a| f64::from(*a)).chain(normalised).chain(embedding).chain(time).collect();
        let parts = [network.action_input, network.context_state.weights, network.context_kappa, network.time_table];
        let layer_1 = activated(affine(&parts.concat(), network.context_state.bias, &input));
        let layer_2 = activated(affine(network.hidden_2.weights, network.hidden_2.bias, &layer_1));
        let layer_3 = activated(affine(network.hidden_3.weights, network.hidden_3.bias, &layer_2));
        affine(network.output.weights, network.output.bias, &layer_3)
    }

    #[test]
    fn the_hoisted_denoiser_is_the_plain_one() {
        let odd = Shape { state: 5, action: 3, hidden: 37, kappa_hidden: 9, kappa_embedding: 41, steps: 7 };
        for shape in [PAPER, odd, fixture::SMALL] {
            let fixture = Fixture::random(shape, 1).build();
            let image = fixture.image();
            let policy = Policy::load(&image).unwrap();
            let (mut state, mut action) = (vec![0.0; shape.state.into()], vec![0.0; shape.action.into()]);
            let mut denoiser = Denoiser::<16, 256, 1>::new(&policy);
            for n in 1..=usize::from(shape.steps) {
                Noise::new(2).fill_normal(0, n as u64, &mut state);
                Noise::new(2).fill_normal(1, n as u64, &mut action);
                let kappa = Cost::from_incurred(n as f32 * 0.75).unwrap();
                let mut eps = vec![0.0; action.len()];
                denoiser.prepare(&policy, &state, kappa).unwrap();
                denoiser.eps(&policy, n, action.as_chunks().0, eps.as_chunks_mut().0);

                let scaled = f64::from(policy.kappa.scale) * f64::from(kappa.to_f32());
                let expected = reference(image.sections(), &shape, scaled, &state, &action, n);
                for (eps, expected) in eps.iter().zip(expected) {
                    let error = (f64::from(*eps) - expected).abs();
                    assert!(error < 1e-5, "{shape:?}, level {n}: {eps} is {error:e} off {expected}");
                }
            }
        }
    }
}
