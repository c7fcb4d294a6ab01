//! The denoiser `eps(a^n, n | s, kappa)` of Appendix B, with everything that
//! is constant along a chain computed once ([`armor_core::shape`] has the
//! formulas).
//!
//! Order of the sums, which fixes their bits: the context starts at the bias,
//! then come the state entries, then the kappa embedding; the first layer
//! starts at `T[n] + context`, then come the action entries; every other layer
//! starts at its bias.

use armor_core::image::Dense;
use armor_core::mish::mish;
use armor_core::units::Cost;

use crate::kernel;
use crate::policy::Policy;

/// The working memory of a denoiser.
pub(crate) struct Denoiser<const STATE: usize, const HIDDEN: usize> {
    /// The normalised state `[S]`.
    state: [f32; STATE],
    /// `W_s s + W_k e(kappa) + b` of layer 1 `[H]`.
    context: [f32; HIDDEN],
    /// Outputs of layers 1 and 3 `[H]`.
    odd: [f32; HIDDEN],
    /// Outputs of layer 2 `[H]`.
    even: [f32; HIDDEN],
}

impl<const STATE: usize, const HIDDEN: usize> Denoiser<STATE, HIDDEN> {
    /// Memory for policies up to these capacities.
    pub(crate) const fn new() -> Self {
        Self { state: [0.0; STATE], context: [0.0; HIDDEN], odd: [0.0; HIDDEN], even: [0.0; HIDDEN] }
    }

    /// Computes what a chain of `policy` needs of the state `[S]` and the
    /// remaining budget.
    pub(crate) fn prepare(&mut self, policy: &Policy<'_>, state: &[f32], kappa: Cost) {
        let [s, h, k, e] = {
            let shape = &policy.shape;
            [shape.state, shape.hidden, shape.kappa_hidden, shape.kappa_embedding].map(usize::from)
        };
        let numbers = &policy.sections;

        let normalised = front(&mut self.state, s);
        let normaliser = numbers.state_mean.iter().zip(numbers.state_factor);
        for ((out, value), (mean, factor)) in normalised.iter_mut().zip(state).zip(normaliser) {
            *out = (value - mean) * factor;
        }

        let [layer_1, layer_2, layer_3] = &numbers.kappa;
        let first = front(&mut self.odd, k);
        let second = front(&mut self.even, k);
        affine(layer_1, &[policy.kappa.scale * policy.condition(kappa)], first);
        activate(first);
        affine(layer_2, first, second);
        activate(second);
        let embedding = front(&mut self.odd, e);
        affine(layer_3, second, embedding);

        let context = front(&mut self.context, h);
        affine(&numbers.context_state, normalised, context);
        kernel::accumulate(numbers.context_kappa, embedding, context);
    }

    /// The noise that the network sees in `action` `[A]` at noise level `n`,
    /// into `eps` `[A]`, given what [`Denoiser::prepare`] left.
    pub(crate) fn eps(&mut self, policy: &Policy<'_>, n: usize, action: &[f32], eps: &mut [f32]) {
        let h = usize::from(policy.shape.hidden);
        let numbers = &policy.sections;
        let odd = front(&mut self.odd, h);
        let even = front(&mut self.even, h);

        let time = numbers.time_table.get(n.saturating_sub(1) * h..).unwrap_or_default();
        for ((out, time), context) in odd.iter_mut().zip(time).zip(&self.context) {
            *out = time + context;
        }
        kernel::accumulate(numbers.action_input, action, odd);
        activate(odd);
        affine(&numbers.hidden_2, odd, even);
        activate(even);
        affine(&numbers.hidden_3, even, odd);
        activate(odd);
        affine(&numbers.output, odd, eps);
    }
}

/// The first `length` entries of a buffer, or none if it is shorter; the
/// controller has checked that no buffer is.
pub(crate) fn front(buffer: &mut [f32], length: usize) -> &mut [f32] {
    buffer.get_mut(..length).unwrap_or_default()
}

/// `out = bias + W x`.
fn affine(layer: &Dense<'_>, x: &[f32], out: &mut [f32]) {
    for (out, bias) in out.iter_mut().zip(layer.bias) {
        *out = *bias;
    }
    kernel::accumulate(layer.weights, x, out);
}

fn activate(values: &mut [f32]) {
    for value in values {
        *value = mish(*value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{self, Fixture, PAPER};
    use armor_core::image::Sections;
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
        let parts = [numbers.action_input, numbers.context_state.weights, numbers.context_kappa, numbers.time_table];
        let layer_1 = activated(affine(&parts.concat(), numbers.context_state.bias, &input));
        let layer_2 = activated(affine(numbers.hidden_2.weights, numbers.hidden_2.bias, &layer_1));
        let layer_3 = activated(affine(numbers.hidden_3.weights, numbers.hidden_3.bias, &layer_2));
        affine(numbers.output.weights, numbers.output.bias, &layer_3)
    }

    /// A map through (b, b) and (2b, b) is the budget itself up to b, and holds b from there on.
    #[test]
    fn a_mapped_budget_has_the_bits_of_the_budget_it_maps_to() {
        let plain = Fixture::random(fixture::SMALL, 1);
        let mut mapped = plain.clone();
        let knot = |budget: u32, condition: f32| [budget << 16, condition.to_bits()];
        *mapped.section(armor_core::image::SectionKind::BudgetMap) =
            [knot(0, 0.0), knot(8, 8.0), knot(16, 8.0)].concat();
        let context = |fixture: &Fixture, kappa: f32| {
            let image = fixture.image();
            let mut denoiser = Denoiser::<16, 256>::new();
            denoiser.prepare(&Policy::load(&image).unwrap(), &[0.5, -0.5, 1.0], Cost::from_incurred(kappa).unwrap());
            denoiser.context.map(f32::to_bits)
        };
        let (plain, mapped) = (plain.build(), mapped.build());
        for (kappa, seen) in [(0.0, 0.0), (3.25, 3.25), (8.0, 8.0), (11.0, 8.0), (40.0, 8.0)] {
            assert_eq!(context(&mapped, kappa), context(&plain, seen), "{kappa}");
        }
        assert_ne!(context(&plain, 3.25), context(&plain, 8.0));
    }

    #[test]
    fn the_hoisted_denoiser_is_the_plain_one() {
        let odd = Shape { state: 5, action: 3, hidden: 37, kappa_hidden: 9, kappa_embedding: 41, steps: 7 };
        for shape in [PAPER, odd, fixture::SMALL] {
            let fixture = Fixture::random(shape, 1).build();
            let image = fixture.image();
            let policy = Policy::load(&image).unwrap();
            let (mut state, mut action) = (vec![0.0; shape.state.into()], vec![0.0; shape.action.into()]);
            let mut denoiser = Denoiser::<16, 256>::new();
            for n in 1..=usize::from(shape.steps) {
                Noise::new(2).fill_normal(0, n as u64, &mut state);
                Noise::new(2).fill_normal(1, n as u64, &mut action);
                let kappa = Cost::from_incurred(n as f32 * 0.75).unwrap();
                let mut eps = vec![0.0; action.len()];
                denoiser.prepare(&policy, &state, kappa);
                denoiser.eps(&policy, n, &action, &mut eps);

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
