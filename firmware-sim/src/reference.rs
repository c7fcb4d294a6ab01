//! A second opinion on the controller: the chain of an image in plain f64.
//!
//! Written from the paper's formulas and the image's sections, with nothing
//! hoisted and no code of `armor-infer`: layer 1 multiplies one concatenated
//! vector (Appendix B), Mish is spelt out with `tanh` and `ln`, and each step
//! is Eq. 12 as [`armor_core::schedule::ChainStep`] states it. Only the noise
//! is shared, for it is addressed and not computed.

use armor_core::image::{Dense, PolicyImage};
use armor_core::noise::Noise;
use armor_core::schedule::ChainStep;
use armor_core::units::Cost;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// An image's network and chains in f64.
pub struct Reference {
    state_mean: DVector<f64>,
    state_factor: DVector<f64>,
    action_low: DVector<f64>,
    action_high: DVector<f64>,
    kappa_scale: f64,
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

struct Layer {
    weights: DMatrix<f64>,
    bias: DVector<f64>,
}

/// Every number of one chain.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Chain {
    /// The state as the network sees it `[S]`.
    pub state_normalized: Vec<f64>,
    /// The embedding of the remaining budget `[E]`.
    pub kappa_embedding: Vec<f64>,
    /// The pure noise that the chain starts from, `a^N` `[A]`.
    pub start: Vec<f64>,
    /// The steps, from noise level `N` down.
    pub steps: Vec<ChainRow>,
    /// What the chain ends in `[A]`.
    pub action: Vec<f64>,
}

/// Every number of one step of a chain.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChainRow {
    /// The noise level `n` that the step starts from.
    pub n: usize,
    /// The noise that the network sees `[A]`.
    pub eps: Vec<f64>,
    /// The estimate of the action, clipped to the bounds `[A]`.
    pub x0: Vec<f64>,
    /// The standard normal draws of the step `[A]`; 0 where none are added.
    pub noise: Vec<f64>,
    /// The noisy action after the step `[A]`.
    pub action: Vec<f64>,
}

impl Reference {
    /// The network and chains of an image.
    pub fn new(image: &PolicyImage<'_>) -> Self {
        let (manifest, numbers) = (image.manifest(), image.sections());
        let hidden = usize::from(manifest.shape.hidden);
        let layer_1 = [numbers.action_input, numbers.context_state.weights, numbers.context_kappa].concat();
        Self {
            state_mean: vector(numbers.state_mean),
            state_factor: vector(numbers.state_factor),
            action_low: vector(numbers.action_low),
            action_high: vector(numbers.action_high),
            kappa_scale: manifest.kappa.scale.into(),
            kappa: numbers.kappa.map(|dense| layer(&dense)),
            layer_1: layer(&Dense { weights: &layer_1, bias: numbers.context_state.bias }),
            time: matrix(hidden, numbers.time_table),
            layer_2: layer(&numbers.hidden_2),
            layer_3: layer(&numbers.hidden_3),
            output: layer(&numbers.output),
            rungs: (0..manifest.rungs.len()).map(|rung| numbers.chain(manifest, rung).collect()).collect(),
        }
    }

    /// The chain of `rung` that a controller of `seed` flies at control step
    /// `tick`, from a state `[S]` and what is left of its budget.
    ///
    /// # Panics
    /// Where the image has no such rung, or the state not its length.
    pub fn chain(&self, rung: usize, state: &[f32], kappa: Cost, seed: u64, tick: u64) -> Chain {
        let state = (vector(state) - &self.state_mean).component_mul(&self.state_factor);
        let embedding = self.kappa_embedding(kappa);
        let draws = |stream: u32| {
            let mut draws = vec![0.0; self.action_low.len()];
            Noise::new(seed).fill_normal(stream, tick, &mut draws);
            vector(&draws)
        };
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

    fn kappa_embedding(&self, kappa: Cost) -> DVector<f64> {
        let [one, two, three] = &self.kappa;
        let scaled = DVector::from_element(1, self.kappa_scale * f64::from(kappa.to_f32()));
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
    fn apply(&self, input: &DVector<f64>) -> DVector<f64> {
        &self.weights * input + &self.bias
    }
}

/// `x tanh(ln(1 + e^x))`.
fn mish(x: f64) -> f64 {
    x * x.exp().ln_1p().tanh()
}

/// Stored input by input, an image's matrix is one of a column an input.
fn matrix(outputs: usize, weights: &[f32]) -> DMatrix<f64> {
    DMatrix::from_iterator(outputs, weights.len() / outputs, weights.iter().copied().map(f64::from))
}

fn layer(dense: &Dense<'_>) -> Layer {
    Layer { weights: matrix(dense.bias.len(), dense.weights), bias: vector(dense.bias) }
}

fn vector(values: &[f32]) -> DVector<f64> {
    DVector::from_iterator(values.len(), values.iter().copied().map(f64::from))
}

fn list(vector: &DVector<f64>) -> Vec<f64> {
    vector.iter().copied().collect()
}

#[cfg(test)]
mod tests {
    use armor_core::image::SectionKind;
    use armor_core::schedule::VpSchedule;
    use armor_core::units::CostLimit;
    use armor_infer::Policy;

    use super::*;
    use crate::fixture::{BALL_RUN, Parts};
    use crate::host::HostController;
    use crate::memory::AlignedBytes;

    const SEED: u64 = 5;
    const STATE: [f32; 7] = [0.1, -0.2, 0.5, 0.0, 0.3, -0.7, 0.2];

    fn with_image<T>(parts: &Parts, act: impl FnOnce(&PolicyImage<'_>) -> T) -> T {
        let memory = AlignedBytes::from(parts.bytes().as_slice());
        act(&PolicyImage::new_checked(memory.as_slice()).unwrap())
    }

    #[test]
    fn it_agrees_with_the_controller_to_single_precision() {
        for seed in 0..20 {
            with_image(&Parts::random("ball-run", BALL_RUN, seed), |image| {
                let limit = CostLimit::new(7.0).unwrap();
                let mut controller = HostController::new(Policy::load(image).unwrap(), limit, SEED).unwrap();
                let reference = Reference::new(image);
                for tick in 0..5 {
                    let step = controller.step(&STATE, 1.0);
                    let chain = reference.chain(step.rung, &STATE, step.kappa, SEED, tick);
                    for (entry, expected) in step.action.iter().zip(chain.action) {
                        assert!((f64::from(*entry) - expected).abs() < 2e-5, "{entry} is not {expected}");
                    }
                }
            });
        }
    }

    /// A network that always says `eps = 0.5`: the deterministic chain keeps
    /// its first estimate, `(a^N - sqrt(1 - abar_N) / 2) / sqrt(abar_N)`, clipped.
    #[test]
    fn the_deterministic_chain_of_a_constant_network_has_a_closed_form() {
        let mut parts = Parts::random("ball-run", BALL_RUN, 1);
        let output = parts.section(SectionKind::Output);
        let biases = output.len() - 2;
        output.fill(0);
        output[biases..].fill(0.5f32.to_bits());
        let bounds = [-1e3f32, 1e3, 0.0].map(|bound| [bound.to_bits(); 2]);
        *parts.section(SectionKind::ActionBounds) = bounds.concat();
        let chain = with_image(&parts, |image| Reference::new(image).chain(1, &STATE, Cost::ZERO, SEED, 3));
        let mut start = [0.0; 2];
        Noise::new(SEED).fill_normal(0, 3, &mut start);
        let abar = VpSchedule::new(5).alpha_bar(5);
        for (entry, start) in start.into_iter().map(f64::from).enumerate() {
            let expected = (start - 0.5 * (1.0 - abar).sqrt()) / abar.sqrt();
            assert!((chain.action[entry] - expected).abs() < 1e-5 * expected.abs(), "{chain:?}");
            assert_eq!(chain.start[entry], start);
        }
        assert_eq!(chain.steps.iter().map(|step| step.n).collect::<Vec<_>>(), [5, 3]);
        assert!(chain.steps.iter().all(|step| step.eps == [0.5; 2] && step.noise == [0.0; 2]));
    }

    #[test]
    fn each_row_follows_from_the_one_before_by_eq_12() {
        let parts = Parts::random("ball-run", BALL_RUN, 1);
        let chain = with_image(&parts, |image| Reference::new(image).chain(0, &STATE, Cost::ZERO, SEED, 0));
        let schedule = VpSchedule::new(5);
        let mut before = chain.start.clone();
        for row in &chain.steps {
            let (here, there) = (schedule.alpha_bar(row.n), schedule.alpha_bar(row.n - 1));
            let beta = schedule.beta(row.n);
            for (entry, before) in before.iter().enumerate() {
                let estimate = (before - (1.0 - here).sqrt() * row.eps[entry]) / here.sqrt();
                let x0 = estimate.clamp(-1.0, 1.0);
                assert!((row.x0[entry] - x0).abs() < 1e-6);
                let mean = beta * there.sqrt() / (1.0 - here) * x0
                    + (1.0 - there) * (here / there).sqrt() / (1.0 - here) * before;
                let sigma = (beta * (1.0 - there) / (1.0 - here)).sqrt();
                assert!((row.action[entry] - mean - sigma * row.noise[entry]).abs() < 1e-6);
            }
            before.clone_from(&row.action);
        }
        assert_eq!(before, chain.action);
    }
}
