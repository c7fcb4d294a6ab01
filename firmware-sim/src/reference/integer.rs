//! The chain of an integer image, bit for bit, written from `docs/numerics.md`:
//! wide integers for what is integer there, f32 for what is f32. It lays all
//! weights out as matrices of whole numbers and computes its own table of Mish.

use armor_core::budget_map::BudgetMap;
use armor_core::image::{Dense, IntegerNetwork, Layout, PolicyImage, Precision, Rows};
use armor_core::mish::mish;
use armor_core::schedule::ChainStep;
use armor_core::units::Cost;
use nalgebra::{DMatrix, DVector};

use super::{Chain, ChainRow, draws};

/// An integer image's network and chains.
pub struct IntegerReference {
    state_mean: Vec<f32>,
    state_factor: Vec<f32>,
    action_low: Vec<f32>,
    action_high: Vec<f32>,
    /// Knots of the budget map, raw budget and condition bits; none where the condition is the budget.
    budget_map: Vec<[u32; 2]>,
    kappa_scale: f32,
    /// Weights output by output, and biases.
    kappa: [(Vec<Vec<f32>>, Vec<f32>); 3],
    context_state: Layer,
    context_kappa: Layer,
    context_bias: DVector<i64>,
    /// Column `n - 1` for noise level `n`, shifted.
    time: DMatrix<i64>,
    action_input: DMatrix<i64>,
    hidden: [(Layer, DVector<i64>); 2],
    /// Weights of 15 bits, output by output.
    output: DMatrix<i64>,
    output_factor: Vec<f32>,
    output_bias: Vec<f32>,
    state_unit: f32,
    kappa_unit: f32,
    action_factor: f32,
    action_shift: u32,
    /// For each noise level: activation factors, rescales, scale of the last codes.
    levels: Vec<([i64; 3], [i64; 2], f32)>,
    /// Bits of the hidden codes.
    bits: u32,
    /// `mish(z) - max(z, 0)` in steps of `2^-16`, for `z` from -16 to 8 in steps of 1/32.
    residual: Vec<i64>,
    rungs: Vec<Vec<ChainStep>>,
}

struct Layer {
    weights: DMatrix<i64>,
    multiplier: DVector<i64>,
}

impl IntegerReference {
    pub(super) fn new(image: &PolicyImage<'_>, network: &IntegerNetwork<'_>) -> Self {
        let (manifest, numbers) = (image.manifest(), image.sections());
        let [s, a, h, e, n] = {
            let shape = &manifest.shape;
            [shape.state, shape.action, shape.hidden, shape.kappa_embedding, shape.steps].map(usize::from)
        };
        let wide =
            |values: &[i16], rows| DMatrix::from_iterator(rows, values.len() / rows, values.iter().map(|&v| v.into()));
        let parts = matrix(network.output, network.layout, 2 * a, h);
        let residual = |index: u32| {
            let z = f64::from(index) / 32.0 - 16.0;
            ((z * z.exp().ln_1p().tanh() - z.max(0.0)) * 65536.0).round() as i64
        };
        let level = |n| {
            let level = network.level(n).expect("a checked image has the scales of all its levels");
            (level.activate.map(i64::from), level.rescale.map(i64::from), level.last_scale)
        };
        Self {
            state_mean: numbers.state_mean.into(),
            state_factor: numbers.state_factor.into(),
            action_low: numbers.action_low.into(),
            action_high: numbers.action_high.into(),
            budget_map: numbers
                .budget_map
                .map(|map| map.knots().map(|(budget, condition)| [budget.to_raw(), condition.to_bits()]).collect())
                .unwrap_or_default(),
            kappa_scale: manifest.kappa.scale,
            kappa: numbers.kappa.map(|dense| by_output(&dense)),
            context_state: layer(&network.context_state, network.layout, s),
            context_kappa: layer(&network.context_kappa, network.layout, e),
            context_bias: whole(network.context_bias),
            time: wide(network.time_table, h) * (1 << network.time_shift),
            action_input: wide(network.action_input, h),
            hidden: [
                (layer(&network.hidden_2, network.layout, h), whole(network.bias_2)),
                (layer(&network.hidden_3, network.layout, h), whole(network.bias_3)),
            ],
            output: DMatrix::from_fn(a, h, |row, column| 128 * parts[(2 * row, column)] + parts[(2 * row + 1, column)]),
            output_factor: network.output_factor.into(),
            output_bias: network.output_bias.into(),
            state_unit: network.state_unit,
            kappa_unit: network.kappa_unit,
            action_factor: network.action_factor,
            action_shift: network.action_shift,
            levels: (1..=n).map(level).collect(),
            bits: if manifest.precision == Precision::Int8 { 7 } else { 15 },
            residual: (0..=24 * 32).map(residual).collect(),
            rungs: (0..manifest.rungs.len()).map(|rung| numbers.chain(manifest, rung).collect()).collect(),
        }
    }

    pub(super) fn chain(&self, rung: usize, state: &[f32], kappa: Cost, [seed, tick]: [u64; 2], first: u32) -> Chain {
        let normaliser = self.state_mean.iter().zip(&self.state_factor);
        let state: Vec<f32> = state.iter().zip(normaliser).map(|(s, (mean, factor))| (s - mean) * factor).collect();
        let embedding = self.kappa_embedding(kappa);
        let context = &self.context_bias
            + hoisted(&self.context_state, &state, self.state_unit)
            + hoisted(&self.context_kappa, &embedding, self.kappa_unit);
        let draws = |stream: u32| draws(self.action_low.len(), seed, first + stream, tick);
        let start = draws(0);
        let mut action = start.clone();
        let mut steps = Vec::new();
        for (stream, step) in (1..).zip(&self.rungs[rung]) {
            let eps = self.eps(&context, &action, step.n);
            let bounds = self.action_low.iter().zip(&self.action_high);
            let estimates = action.iter().zip(&eps).map(|(a, eps)| step.from_action * a - step.from_noise * eps);
            let x0: Vec<f32> = estimates.zip(bounds).map(|(x0, (low, high))| x0.clamp(*low, *high)).collect();
            let noise = if step.sigma == 0.0 { vec![0.0; action.len()] } else { draws(stream) };
            for ((a, x0), z) in action.iter_mut().zip(&x0).zip(&noise) {
                *a = (step.to_x0 * x0 + step.to_action * *a) + step.sigma * z;
            }
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

    fn kappa_embedding(&self, kappa: Cost) -> Vec<f32> {
        let [one, two, three] = &self.kappa;
        let condition = BudgetMap::new(&self.budget_map).map_or(kappa.to_f32(), |map| map.condition(kappa));
        let active = |values: Vec<f32>| values.into_iter().map(mish).collect::<Vec<f32>>();
        affine(three, &active(affine(two, &active(affine(one, &[self.kappa_scale * condition])))))
    }

    /// `eps(a^n, n | s, kappa)`, given what `s` and `kappa` make of layer 1.
    fn eps(&self, context: &DVector<i64>, action: &[f32], n: usize) -> Vec<f32> {
        let (activate, rescale, last_scale) = self.levels[n - 1];
        let mut pre = context + self.time.column(n - 1);
        for (entry, weights) in action.iter().zip(self.action_input.column_iter()) {
            let code = round(entry * self.action_factor);
            pre += weights.map(|weight| (code * weight) >> self.action_shift);
        }
        let mut codes = self.activate(&pre, activate[0], self.bits);
        for (index, (layer, bias)) in self.hidden.iter().enumerate() {
            let sums = (&layer.weights * &codes) * (1 << (15 - self.bits));
            let pre = sums.component_mul(&layer.multiplier).map(high) * rescale[index];
            let bits = if index == 0 { self.bits } else { 15 };
            codes = self.activate(&(pre.map(high) + bias), activate[index + 1], bits);
        }
        let outputs = self.output_factor.iter().zip(&self.output_bias).enumerate();
        // The high and low parts of the weights are summed apart, each rounded to f32.
        let sum = |output: usize, part: &dyn Fn(i64) -> i64| {
            self.output.row(output).iter().zip(codes.iter()).map(|(w, code)| part(*w) * code).sum::<i64>() as f32
        };
        outputs
            .map(|(output, (factor, bias))| {
                let (top, low) = (|w: i64| (w + 64).div_euclid(128), |w: i64| (w + 64).rem_euclid(128) - 64);
                (sum(output, &top) * 128.0 + sum(output, &low)) * (factor * last_scale) + bias
            })
            .collect()
    }

    /// Codes of Mish of pre-activations in steps of `2^-12`.
    fn activate(&self, pre: &DVector<i64>, factor: i64, bits: u32) -> DVector<i64> {
        pre.map(|z| {
            let at = (z + 16 * 4096).clamp(0, 24 * 4096 - 1);
            let (index, fraction) = ((at / 128) as usize, at % 128);
            let residual = self.residual[index] * (128 - fraction) + self.residual[index + 1] * fraction;
            // In steps of 2^-23, above -5/16.
            let activation = z.clamp(0, 128 * 4096 - 1) * 2048 + residual + 5 * (1 << 19);
            high(activation * factor).min((1 << bits) - 1)
        })
    }
}

/// `product / 2^32`, to the nearest, halves up.
fn high(product: i64) -> i64 {
    (product + (1 << 31)).div_euclid(1 << 32)
}

/// To the nearest code of 15 bits and a sign, halves away from zero.
fn round(x: f32) -> i64 {
    let half = if x < 0.0 { -0.5 } else { 0.5 };
    ((x + half).trunc() as i64).clamp(-32767, 32767)
}

/// A part of layer 1 over values that are scaled by their largest.
fn hoisted(layer: &Layer, values: &[f32], unit: f32) -> DVector<i64> {
    let largest = values.iter().fold(0.0f32, |largest, value| largest.max(value.abs()));
    let factor = 32767.0 / largest;
    let codes = DVector::from_iterator(values.len(), values.iter().map(|value| round(value * factor)));
    let rescale = i64::from((largest * unit) as i32);
    (&layer.weights * codes).component_mul(&layer.multiplier).map(|product| high(high(product) * rescale))
}

fn layer(rows: &Rows<'_>, layout: Layout, inputs: usize) -> Layer {
    let weights = matrix(rows.weights, layout, rows.multiplier.len(), inputs);
    Layer { weights, multiplier: whole(rows.multiplier) }
}

/// The weights as whole numbers; paired, a half-word is `256 high + low + 128`.
fn matrix(bytes: &[i8], layout: Layout, rows: usize, columns: usize) -> DMatrix<i64> {
    let byte = |at: usize| i64::from(bytes[at]);
    DMatrix::from_fn(rows, columns, |row, column| match layout {
        Layout::Rows => byte(row * columns + column),
        Layout::Paired => {
            let block = 16 * ((row / 4) * columns.div_ceil(4) + column / 4);
            let pair = block + 8 * (row / 2 % 2) + 2 * (column % 4);
            let half_word = 256 * byte(pair + 1) + byte(pair).rem_euclid(256);
            if row % 2 == 0 { half_word.rem_euclid(256) - 128 } else { half_word.div_euclid(256) }
        }
    })
}

fn whole(values: &[i32]) -> DVector<i64> {
    DVector::from_iterator(values.len(), values.iter().map(|&value| value.into()))
}

fn by_output(dense: &Dense<'_>) -> (Vec<Vec<f32>>, Vec<f32>) {
    let outputs = dense.bias.len();
    let row = |output| dense.weights.iter().skip(output).step_by(outputs).copied().collect();
    ((0..outputs).map(row).collect(), dense.bias.into())
}

/// Each output starts at its bias and takes the inputs in their order.
fn affine((weights, bias): &(Vec<Vec<f32>>, Vec<f32>), input: &[f32]) -> Vec<f32> {
    let sum = |(row, bias): (&Vec<f32>, &f32)| row.iter().zip(input).fold(*bias, |sum, (w, x)| sum + x * w);
    weights.iter().zip(bias).map(sum).collect()
}

fn list(values: &[f32]) -> Vec<f64> {
    values.iter().copied().map(f64::from).collect()
}
