//! The integer sections of an image.

use std::collections::HashMap;

use armor_core::fixed::{ACTIVATION_BITS, LONG_BITS, LOWEST, MAX_BIAS, PRE_BITS};
use armor_core::image::{Dense, Layout, LevelScales, Network, PolicyImage, SectionKind};
use armor_core::noise::MAX_NORMAL;

use super::calibration::Calibration;
use super::weights::QuantizedRows;
use crate::export::ExportError;

/// Steps of a pre-activation in 1.
const PRE_ONE: f64 = (1u32 << PRE_BITS) as f64;
/// The largest code of 15 bits.
const LONGEST: f64 = ((1u32 << LONG_BITS) - 1) as f64;

/// The sections in which an integer policy differs from `image`, in single
/// precision; hidden codes have `bits`, and weights lie in `layout`.
pub(super) fn sections(
    image: &PolicyImage<'_>,
    calibration: &Calibration,
    bits: u32,
    layout: Layout,
) -> Result<HashMap<SectionKind, Vec<u32>>, ExportError> {
    let Network::Float(network) = &image.sections().network else { return Err(ExportError::NotFloat) };
    let shape = image.manifest().shape;
    let h = usize::from(shape.hidden);

    let of_state = QuantizedRows::new(network.context_state.weights, h);
    let of_kappa = QuantizedRows::new(network.context_kappa, h);
    let context_bias: Vec<f64> = network.context_state.bias.iter().map(|&bias| bias.into()).collect();
    let context =
        [rows(&of_state, layout), rows(&of_kappa, layout), biases(SectionKind::Context, &context_bias)?].concat();

    let (time_shift, time_table) = time_table(network.time_table)?;
    let bound = image.sections().action_low.iter().chain(image.sections().action_high);
    let largest_action = f64::from(bound.fold(0.0f32, |largest, bound| largest.max(bound.abs())) + MAX_NORMAL);
    let action_factor = (LONGEST / largest_action) as f32;
    let (action_shift, action_input) = action_input(network.action_input, action_factor.into())?;

    let (rows_2, hidden_2) = hidden(SectionKind::Hidden2, &network.hidden_2, &calibration.means[0], layout)?;
    let (rows_3, hidden_3) = hidden(SectionKind::Hidden3, &network.hidden_3, &calibration.means[1], layout)?;

    let unit = |rows: &QuantizedRows| (rescale(rows.scale, 1.0 / LONGEST) as f32).to_bits();
    let mut scales = vec![unit(&of_state), unit(&of_kappa), action_factor.to_bits(), time_shift, action_shift];
    for n in 1..=usize::from(shape.steps) {
        let layers = [(0, bits), (1, bits), (2, LONG_BITS)];
        let activate = layers.map(|(layer, bits)| activate(calibration.range(layer, n, bits), bits));
        let aligned = |factor: i32| code_scale(factor) / f64::from(1u32 << (LONG_BITS - bits));
        let rescale_2 = integer(SectionKind::Hidden2, rescale(rows_2.scale, aligned(activate[0])))?;
        let rescale_3 = integer(SectionKind::Hidden3, rescale(rows_3.scale, aligned(activate[1])))?;
        let last_scale = code_scale(activate[2]) as f32;
        scales.extend(LevelScales { activate, rescale: [rescale_2, rescale_3], last_scale }.to_words());
    }

    Ok(HashMap::from([
        (SectionKind::Context, context),
        (SectionKind::TimeTable, time_table),
        (SectionKind::ActionInput, action_input),
        (SectionKind::Hidden2, hidden_2),
        (SectionKind::Hidden3, hidden_3),
        (SectionKind::Output, output(&network.output, layout)),
        (SectionKind::Scales, scales),
    ]))
}

/// The factor of [`armor_core::fixed::activate`] whose highest code stands for `range`.
fn activate(range: f64, bits: u32) -> i32 {
    let step = (range - LOWEST) / f64::from((1u32 << bits) - 1);
    // An activation is at least 0, so the step is at least 0.3125 / 32767 and the factor fits.
    (f64::from(1u32 << (32 - ACTIVATION_BITS)) / step).round().max(1.0) as i32
}

/// What a step of a code stands for, by its factor.
fn code_scale(factor: i32) -> f64 {
    f64::from(1u32 << (32 - ACTIVATION_BITS)) / f64::from(factor)
}

/// The last factor of [`armor_core::fixed::rescale`]: a row's multiplier and
/// the two roundings take `2^-33` and its own scale, so this gives it back.
fn rescale(weight_scale: f64, code_scale: f64) -> f64 {
    weight_scale * code_scale * PRE_ONE * 2f64.powi(33)
}

fn integer(kind: SectionKind, value: f64) -> Result<i32, ExportError> {
    let rounded = value.round();
    if rounded <= f64::from(i32::MAX) { Ok(rounded.max(1.0) as i32) } else { Err(ExportError::Range(kind)) }
}

/// A hidden layer's integers, and its section.
fn hidden(
    kind: SectionKind,
    layer: &Dense<'_>,
    means: &[f64],
    layout: Layout,
) -> Result<(QuantizedRows, Vec<u32>), ExportError> {
    let quantized = QuantizedRows::new(layer.weights, layer.bias.len());
    let shortfall = quantized.shortfall(layer.weights, means);
    let shifts = quantized.sums.iter().zip(&shortfall).map(|(sum, shortfall)| LOWEST * sum + shortfall);
    let bias: Vec<f64> = layer.bias.iter().zip(shifts).map(|(&bias, shift)| f64::from(bias) + shift).collect();
    let section = [rows(&quantized, layout), biases(kind, &bias)?].concat();
    Ok((quantized, section))
}

/// The output layer with weights of 15 bits, in a high and a low part.
fn output(layer: &Dense<'_>, layout: Layout) -> Vec<u32> {
    const HIGHEST: f64 = 127.0 * 128.0;
    let outputs = layer.bias.len();
    let (mut codes, mut factors, mut biases) = (Vec::new(), Vec::new(), Vec::new());
    for (output, &bias) in layer.bias.iter().enumerate() {
        let row: Vec<f64> = layer.weights.iter().skip(output).step_by(outputs).map(|&w| w.into()).collect();
        let largest = row.iter().fold(f64::from(f32::MIN_POSITIVE), |largest, weight| largest.max(weight.abs()));
        let factor = (largest / HIGHEST) as f32;
        let whole: Vec<i32> =
            row.iter().map(|w| (w / f64::from(factor)).round().clamp(-HIGHEST, HIGHEST) as i32).collect();
        let high = |whole: i32| (whole + 64) >> 7;
        codes.extend(whole.iter().map(|&whole| high(whole) as i8));
        codes.extend(whole.iter().map(|&whole| (whole - 128 * high(whole)) as i8));
        let sum = f64::from(factor) * whole.iter().map(|&whole| f64::from(whole)).sum::<f64>();
        factors.push(factor.to_bits());
        biases.push(((f64::from(bias) + LOWEST * sum) as f32).to_bits());
    }
    [matrix(&codes, 2 * outputs, layout), factors, biases].concat()
}

/// The time table in 16 bits, with the least shift that holds it.
fn time_table(table: &[f32]) -> Result<(u32, Vec<u32>), ExportError> {
    let largest = PRE_ONE * table.iter().fold(0.0f64, |largest, &value| largest.max(f64::from(value).abs()));
    let fits = |shift: &u32| largest / f64::from(1u32 << shift) <= LONGEST;
    let shift = (0..=8).find(fits).ok_or(ExportError::Range(SectionKind::TimeTable))?;
    let codes = table.iter().map(|&value| (f64::from(value) * PRE_ONE / f64::from(1u32 << shift)).round() as i16);
    Ok((shift, pack_halves(codes)))
}

/// The action part of layer 1 in 16 bits, with the largest shift that leaves room for it.
fn action_input(weights: &[f32], action_factor: f64) -> Result<(u32, Vec<u32>), ExportError> {
    let steps = |weight: f32, shift: u32| f64::from(weight) * PRE_ONE * f64::from(1u32 << shift) / action_factor;
    let largest = weights.iter().fold(0.0f32, |largest, weight| largest.max(weight.abs()));
    let fits = |shift: &u32| steps(largest, *shift) <= LONGEST;
    let shift = (8..=16).rev().find(fits).ok_or(ExportError::Range(SectionKind::ActionInput))?;
    Ok((shift, pack_halves(weights.iter().map(|&weight| steps(weight, shift).round() as i16))))
}

fn biases(kind: SectionKind, biases: &[f64]) -> Result<Vec<u32>, ExportError> {
    let steps = biases.iter().map(|bias| (bias * PRE_ONE).round());
    steps
        .map(|bias| if bias.abs() <= MAX_BIAS.into() { Ok(bias as i32 as u32) } else { Err(ExportError::Range(kind)) })
        .collect()
}

fn rows(rows: &QuantizedRows, layout: Layout) -> Vec<u32> {
    let multiplier = rows.multiplier.iter().map(|&multiplier| multiplier as u32).collect();
    [matrix(&rows.codes, rows.multiplier.len(), layout), multiplier].concat()
}

/// The codes of `rows`, given row after row, as an image has them.
fn matrix(codes: &[i8], rows: usize, layout: Layout) -> Vec<u32> {
    let columns = codes.len() / rows;
    let mut bytes = vec![0; layout.bytes(rows, columns)];
    layout.arrange(codes, columns, &mut bytes);
    pack_bytes(&bytes)
}

/// Bytes as words, the last one filled up with zeros.
fn pack_bytes(bytes: &[i8]) -> Vec<u32> {
    let word = |bytes: &[i8]| bytes.iter().rev().fold(0, |word, &byte| word << 8 | u32::from(byte as u8));
    bytes.chunks(4).map(word).collect()
}

/// Half-words as words, the last one filled up with zeros.
fn pack_halves(halves: impl Iterator<Item = i16>) -> Vec<u32> {
    let halves: Vec<i16> = halves.collect();
    let word = |halves: &[i16]| halves.iter().rev().fold(0, |word, &half| word << 16 | u32::from(half as u16));
    halves.chunks(2).map(word).collect()
}
