//! The chain of a single-precision image in plain f64.
//!
//! Nothing is hoisted: layer 1 multiplies one concatenated vector (Appendix
//! B), Mish is spelt out with `tanh` and `ln`, and each step is Eq. 12 as
//! [`armor_core::schedule::ChainStep`] states it.

use armor_core::image::{Dense, FloatNetwork, PolicyImage};
use armor_core::schedule::ChainStep;
use armor_core::units::Cost;
use nalgebra::{DMatrix, DVector};

use super::{Chain, ChainRow, draws};

/// An image's network and chains in f64.
pub struct FloatReference {
    state_mean: DVector<f64>,
    state_factor: DVector<f64>,
    action_low: DVector<f64>,
    action_high: DVector<f64>,
    kappa_scale: f64,
    /// Knots of the image's budget map; empty where it has none.
    budget_map: Vec<(Cost, f64)>,
    kappa: [Layer; 3],
    /// Layer 1 over the action, the normalised state and the kappa embedding, one after the other.
    layer_1: Layer,
    /// Column `n - 1` for noise level `n`.
    time: DMatrix<f64>,
    layer_2: Layer,
    layer_3: Layer,
    output: Layer,
    rungs: Vec<Vec<ChainStep>>,
}

pub(super) struct Layer {
    weights: DMatrix<f64>,
    bias: DVector<f64>,
}

impl FloatReference {
    pub(super) fn new(image: &PolicyImage<'_>, network: &FloatNetwork<'_>) -> Self {
        let (manifest, numbers) = (image.manifest(), image.sections());
        let hidden = usize::from(manifest.shape.hidden);
        let layer_1 = [network.action_input, network.context_state.weights, network.context_kappa].concat();
        Self {
            state_mean: vector(numbers.state_mean),
            state_factor: vector(numbers.state_factor),
            action_low: vector(numbers.action_low),
            action_high: vector(numbers.action_high),
            kappa_scale: manifest.kappa.scale.into(),
            budget_map: numbers
                .budget_map
                .iter()
                .flat_map(|map| map.knots())
                .map(|(budget, x)| (budget, x.into()))
                .collect(),
            kappa: numbers.kappa.map(|dense| layer(&dense)),
            layer_1: layer(&Dense { weights: &layer_1, bias: network.context_state.bias }),
            time: matrix(hidden, network.time_table),
            layer_2: layer(&network.hidden_2),
            layer_3: layer(&network.hidden_3),
            output: layer(&network.output),
            rungs: (0..manifest.rungs.len()).map(|rung| numbers.chain(manifest, rung).collect()).collect(),
        }
    }

    pub(super) fn chain(&self, rung: usize, state: &[f32], kappa: Cost, [seed, tick]: [u64; 2], first: u32) -> Chain {
        let state = (vector(state) - &self.state_mean).component_mul(&self.state_factor);
        let embedding = self.kappa_embedding(kappa);
        let draws = |stream: u32| vector(&draws(self.action_low.len(), seed, first + stream, tick));
        let start = draws(0);
        let mut action = start.clone();
        let mut steps = Vec::new();
        for (stream, step) in (1..).zip(&self.rungs[rung]) {
            let [from_action, from_noise, to_x0, to_action, sigma] =
                [step.from_action, step.from_noise, step.to_x0, step.to_action, step.sigma].map(f64::from);
            let eps = self.eps(&action, step.n, &state, &embedding);
            let x0 = (from_action * &action - from_noise * &eps).sup(&self.action_low).inf(&self.action_high);
            let noise = if sigma == 0.0 { DVector::zeros(action.len()) } else { draws(stream) };
            action = to_x0 * &x0 + to_action * &action + sigma * &noise;
            steps.push(ChainRow {
                n: step.n,
                eps: list(&eps),
                x0: list(&x0),
                noise: list(&noise),
                action: list(&action),
            });
        }
        Chain {
            state_normalized: list(&state),
            kappa_embedding: list(&embedding),
            start: list(&start),
            steps,
            action: list(&action),
        }
    }

    /// The remaining budget, or what the image's map makes of it.
    pub(super) fn condition(&self, kappa: Cost) -> f64 {
        let units = |budget: Cost| f64::from(budget.to_raw()) / 65536.0;
        let above = self.budget_map.iter().position(|(budget, _)| *budget > kappa);
        match (self.budget_map.as_slice(), above) {
            ([], _) => kappa.to_f32().into(),
            ([.., (_, last)], None) => *last,
            ([(_, first), ..], Some(0)) => *first,
            (knots, Some(after)) => {
                let [(start, low), (end, high)] = [knots[after - 1], knots[after]];
                low + (units(kappa) - units(start)) / (units(end) - units(start)) * (high - low)
            }
        }
    }

    fn kappa_embedding(&self, kappa: Cost) -> DVector<f64> {
        let [one, two, three] = &self.kappa;
        let scaled = DVector::from_element(1, self.kappa_scale * self.condition(kappa));
        three.apply(&two.apply(&one.apply(&scaled).map(mish)).map(mish))
    }

    /// `eps(a^n, n | s, kappa)` of Appendix B.
    fn eps(&self, action: &DVector<f64>, n: usize, state: &DVector<f64>, embedding: &DVector<f64>) -> DVector<f64> {
        let parts = action.iter().chain(state.iter()).chain(embedding.iter());
        let input = DVector::from_iterator(action.len() + state.len() + embedding.len(), parts.copied());
        let h_1 = (self.layer_1.apply(&input) + self.time.column(n - 1)).map(mish);
        let h_2 = self.layer_2.apply(&h_1).map(mish);
        let h_3 = self.layer_3.apply(&h_2).map(mish);
        self.output.apply(&h_3)
    }
}

impl Layer {
    pub(super) fn apply(&self, input: &DVector<f64>) -> DVector<f64> {
        &self.weights * input + &self.bias
    }
}

/// `x tanh(ln(1 + e^x))`.
pub(super) fn mish(x: f64) -> f64 {
    x * x.exp().ln_1p().tanh()
}

/// Stored input by input, an image's matrix is one of a column an input.
fn matrix(outputs: usize, weights: &[f32]) -> DMatrix<f64> {
    DMatrix::from_iterator(outputs, weights.len() / outputs, weights.iter().copied().map(f64::from))
}

pub(super) fn layer(dense: &Dense<'_>) -> Layer {
    Layer { weights: matrix(dense.bias.len(), dense.weights), bias: vector(dense.bias) }
}

fn vector(values: &[f32]) -> DVector<f64> {
    DVector::from_iterator(values.len(), values.iter().copied().map(f64::from))
}

fn list(vector: &DVector<f64>) -> Vec<f64> {
    vector.iter().copied().collect()
}
