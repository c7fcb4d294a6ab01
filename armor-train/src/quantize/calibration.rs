//! How large the activations of the hidden layers are, at each noise level:
//! the chains of every rung, in single precision, from recorded states and budgets.

use armor_core::fixed::LOWEST;
use armor_core::image::{Dense, FloatNetwork, Network, PolicyImage};
use armor_core::mish::mish;
use armor_core::noise::{Noise, below};
use armor_core::units::Cost;
use nalgebra::DMatrix;

use crate::data::Dataset;
use crate::export::ExportError;

/// Recorded states whose chains are run.
const SAMPLES: usize = 256;
/// Ranges that are tried, in parts of the largest activation.
const TRIED: std::ops::RangeInclusive<u32> = 8..=32;

/// The activations of a policy's hidden layers.
pub(super) struct Calibration {
    /// What layers 1, 2 and 3 answered at each noise level, from level 1 on.
    levels: Vec<[Vec<f32>; 3]>,
    /// Mean of each unit of layers 1 and 2 over all levels `[H]`.
    pub(super) means: [Vec<f64>; 2],
}

impl Calibration {
    /// Runs the chains of a single-precision image.
    pub(super) fn new(image: &PolicyImage<'_>, data: &Dataset) -> Result<Self, ExportError> {
        let Network::Float(network) = &image.sections().network else { return Err(ExportError::NotFloat) };
        let manifest = image.manifest();
        let context = context(image, network, data);
        let mut levels = vec![[const { Vec::new() }; 3]; manifest.shape.steps.into()];
        for rung in 0..manifest.rungs.len() {
            let mut action = draws(0, manifest.shape.action.into());
            for (stream, step) in (1..).zip(image.sections().chain(manifest, rung)) {
                let (hidden, eps) = layers(network, &context, &action, step.n);
                for (seen, hidden) in levels[step.n - 1].iter_mut().zip(&hidden) {
                    seen.extend_from_slice(hidden.as_slice());
                }
                let noise = draws(stream, manifest.shape.action.into());
                for (mut action, (eps, noise)) in
                    action.column_iter_mut().zip(eps.column_iter().zip(noise.column_iter()))
                {
                    let bounds = image.sections().action_low.iter().zip(image.sections().action_high);
                    for (row, (low, high)) in bounds.enumerate() {
                        let estimate = step.from_action * action[row] - step.from_noise * eps[row];
                        let x0 = estimate.clamp(*low, *high);
                        action[row] = step.to_x0 * x0 + step.to_action * action[row] + step.sigma * noise[row];
                    }
                }
            }
        }
        let hidden = manifest.shape.hidden.into();
        let means = [0, 1].map(|layer| mean_of_units(levels.iter().map(|level| &level[layer]), hidden));
        Ok(Self { levels, means })
    }

    /// The largest activation that a code of `bits` should tell apart in
    /// `layer` (from 0) at noise level `n`: what lies above is clipped, and the
    /// mean square of clipping and rounding together is least. Where no chain
    /// visits the level, that of all levels.
    pub(super) fn range(&self, layer: usize, n: usize, bits: u32) -> f64 {
        let here = &self.levels[n - 1][layer];
        let all: Vec<f32>;
        let values = if here.is_empty() {
            all = self.levels.iter().flat_map(|level| &level[layer]).copied().collect();
            &all
        } else {
            here
        };
        let largest = values.iter().copied().fold(0.0f32, f32::max).into();
        let codes = f64::from((1u32 << bits) - 1);
        let error = |range: f64| {
            let rounding = ((range - LOWEST) / codes).powi(2) / 12.0;
            let clipped = values.iter().map(|&value| (f64::from(value) - range).max(0.0).powi(2)).sum::<f64>();
            rounding + clipped / values.len().max(1) as f64
        };
        let tried = TRIED.map(|part| f64::from(part) / f64::from(*TRIED.end()) * largest);
        tried.min_by(|a, b| error(*a).total_cmp(&error(*b))).unwrap_or(largest)
    }
}

/// `W_s s + W_k e(kappa) + b` for random recorded states and budgets, `H x SAMPLES`.
fn context(image: &PolicyImage<'_>, network: &FloatNetwork<'_>, data: &Dataset) -> DMatrix<f32> {
    let numbers = image.sections();
    let row = |sample| below(Noise::new(1).words(u32::MAX, sample, 0)[0], data.len() as u32) as usize;
    let rows: Vec<usize> = (0..SAMPLES as u64).map(row).collect();
    let state = DMatrix::from_fn(data.state_dim(), SAMPLES, |entry, sample| {
        let value = data.observation(rows[sample])[entry];
        (value - numbers.state_mean[entry]) * numbers.state_factor[entry]
    });
    let scale = image.manifest().kappa.scale;
    let kappa = DMatrix::from_fn(1, SAMPLES, |_, sample| {
        let kappa = Cost::from_incurred(data.kappa(rows[sample])).unwrap_or(Cost::MAX);
        scale * numbers.budget_map.map_or(kappa.to_f32(), |map| map.condition(kappa))
    });
    let [one, two, three] = &numbers.kappa;
    let hidden = affine(two, &affine(one, &kappa).map(mish)).map(mish);
    let embedding = affine(three, &hidden);
    affine(&network.context_state, &state) + matrix(network.context_kappa, network.context_state.bias.len()) * embedding
}

/// The hidden layers and the noise that the network sees in `action`.
fn layers(
    network: &FloatNetwork<'_>,
    context: &DMatrix<f32>,
    action: &DMatrix<f32>,
    n: usize,
) -> ([DMatrix<f32>; 3], DMatrix<f32>) {
    let h = context.nrows();
    let mut first = matrix(network.action_input, h) * action + context;
    let time = &network.time_table[(n - 1) * h..][..h];
    for mut column in first.column_iter_mut() {
        for (value, time) in column.iter_mut().zip(time) {
            *value = mish(*value + time);
        }
    }
    let second = affine(&network.hidden_2, &first).map(mish);
    let third = affine(&network.hidden_3, &second).map(mish);
    let eps = affine(&network.output, &third);
    ([first, second, third], eps)
}

fn draws(stream: u32, rows: usize) -> DMatrix<f32> {
    let mut draws = DMatrix::zeros(rows, SAMPLES);
    for (sample, mut column) in draws.column_iter_mut().enumerate() {
        Noise::new(2).fill_normal(stream, sample as u64, column.as_mut_slice());
    }
    draws
}

/// Stored input by input, an image's matrix is one of a column an input.
fn matrix(weights: &[f32], outputs: usize) -> DMatrix<f32> {
    DMatrix::from_column_slice(outputs, weights.len() / outputs, weights)
}

fn affine(layer: &Dense<'_>, input: &DMatrix<f32>) -> DMatrix<f32> {
    let mut output = matrix(layer.weights, layer.bias.len()) * input;
    for mut column in output.column_iter_mut() {
        for (value, bias) in column.iter_mut().zip(layer.bias) {
            *value += bias;
        }
    }
    output
}

fn mean_of_units<'v>(levels: impl Iterator<Item = &'v Vec<f32>>, units: usize) -> Vec<f64> {
    let (mut sums, mut count) = (vec![0.0; units], 0.0);
    for sample in levels.flat_map(|values| values.chunks_exact(units)) {
        for (sum, value) in sums.iter_mut().zip(sample) {
            *sum += f64::from(*value);
        }
        count += 1.0;
    }
    sums.into_iter().map(|sum| sum / count).collect()
}
