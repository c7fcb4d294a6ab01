//! The denoiser in fixed point ([`armor_core::fixed`]): 8-bit weights, integer
//! codes and sums between the `f32` of the sampler and the `f32` of its noise.
//!
//! The state, the kappa embedding and the noisy action come in as 15-bit codes
//! and a sign, the first two scaled by their own largest entry. Between the
//! hidden layers codes have the width of the policy's precision, and those of
//! layer 3 always 15 bits, for the output layer is small.

use armor_core::fixed::{LONG_BITS, long_code, rescale};
use armor_core::image::{IntegerNetwork, Layout, LevelScales, Rows};
use armor_core::units::Cost;

use super::{NotFinite, front, kappa_embedding, normalised};
use crate::kernel::Kernel;
use crate::policy::Policy;

/// The working memory of an integer denoiser for `K` noisy actions at a time.
pub(crate) struct IntegerDenoiser<const STATE: usize, const HIDDEN: usize, const K: usize> {
    /// The codes of the state `[S]`.
    state: OnWords<[i16; STATE]>,
    /// The two layers of the kappa embedding that are in use `[K]`, `[E]`.
    embedding: [[f32; HIDDEN]; 2],
    /// What layer 1 has of bias, state and budget, pre-activations `[H]`.
    context: [i32; HIDDEN],
    /// Sums and pre-activations of a layer `[H]`.
    sums: [[i32; HIDDEN]; K],
    /// Codes of a layer's activations `[H]`.
    codes: OnWords<[[i16; HIDDEN]; K]>,
}

/// Numbers that start on a word, for machines that load two codes at a time.
#[repr(align(4))]
struct OnWords<T>(T);

impl<const STATE: usize, const HIDDEN: usize, const K: usize> IntegerDenoiser<STATE, HIDDEN, K> {
    pub(super) const fn new() -> Self {
        Self {
            state: OnWords([0; STATE]),
            embedding: [[0.0; HIDDEN]; 2],
            context: [0; HIDDEN],
            sums: [[0; HIDDEN]; K],
            codes: OnWords([[0; HIDDEN]; K]),
        }
    }

    pub(super) fn prepare(
        &mut self,
        policy: &Policy<'_>,
        network: &IntegerNetwork<'_>,
        state: &[f32],
        kappa: Cost,
    ) -> Result<(), NotFinite> {
        let context = front(&mut self.context, policy.shape.hidden.into());
        for (out, bias) in context.iter_mut().zip(network.context_bias) {
            *out = *bias;
        }

        let codes = front(&mut self.state.0, policy.shape.state.into());
        let unit = encode(normalised(policy, state), network.state_unit, codes)?;
        let (kernel, layout) = (policy.kernel, network.layout);
        let sums = self.sums.as_flattened_mut();
        add_rows((kernel, layout), &network.context_state, codes, unit, sums, context);

        let [first, second] = &mut self.embedding;
        let embedding = kappa_embedding(policy, kappa, first, second);
        let codes = front(self.codes.0.as_flattened_mut(), embedding.len());
        let unit = encode(embedding.iter().copied(), network.kappa_unit, codes)?;
        add_rows((kernel, layout), &network.context_kappa, codes, unit, sums, context);
        Ok(())
    }

    pub(super) fn eps(
        &mut self,
        policy: &Policy<'_>,
        network: &IntegerNetwork<'_>,
        n: usize,
        action: &[[f32; K]],
        eps: &mut [[f32; K]],
    ) {
        // An image's chains stay within its levels, and integers have a width.
        let (Some(level), Some(bits)) = (network.level(n), policy.precision.code_bits()) else { return };
        let LevelScales { activate, rescale, last_scale } = level;
        let (kernel, layout, h) = (policy.kernel, network.layout, usize::from(policy.shape.hidden));

        let time = network.time_table.get((n - 1) * h..).unwrap_or_default();
        for (column, (sums, codes)) in self.sums.iter_mut().zip(&mut self.codes.0).enumerate() {
            let sums = front(sums, h);
            for ((out, time), context) in sums.iter_mut().zip(time).zip(&self.context) {
                *out = (i32::from(*time) << network.time_shift) + context;
            }
            let entries = action.iter().filter_map(|entry| entry.get(column));
            for (entry, weights) in entries.zip(network.action_input.chunks_exact(h.max(1))) {
                let code = i32::from(long_code(*entry, network.action_factor));
                for (out, weight) in sums.iter_mut().zip(weights) {
                    *out += (code * i32::from(*weight)) >> network.action_shift;
                }
            }
            kernel.activate(sums, activate[0], bits, front(codes, h));
        }

        let layer_2 = (&network.hidden_2, network.bias_2, rescale[0], (activate[1], bits));
        let layer_3 = (&network.hidden_3, network.bias_3, rescale[1], (activate[2], LONG_BITS));
        for (rows, bias, rescale, (activate, width)) in [layer_2, layer_3] {
            kernel.sum_rows_columns((layout, rows.weights), (&self.codes.0, bits), &mut self.sums, [h, h]);
            for (sums, codes) in self.sums.iter_mut().zip(&mut self.codes.0) {
                let sums = front(sums, h);
                kernel.rescale(sums, bits, rows.multiplier, rescale, bias);
                kernel.activate(sums, activate, width, front(codes, h));
            }
        }

        // Two outputs at a time: a block of the layout is four rows. As much as
        // a block tells the compiler what 1 does not, and else it keeps a panic.
        let weights = network.output.chunks(layout.bytes(Layout::BLOCK, h).max(Layout::BLOCK));
        let scales = network.output_factor.chunks(2).zip(network.output_bias.chunks(2));
        for ((eps, weights), (factor, bias)) in eps.chunks_mut(2).zip(weights).zip(scales) {
            for (column, codes) in self.codes.0.iter().enumerate() {
                let mut parts = [0; Layout::BLOCK];
                kernel.sum_rows(layout, weights, codes.get(..h).unwrap_or_default(), LONG_BITS, &mut parts);
                let eps = eps.iter_mut().filter_map(|eps| eps.get_mut(column));
                for (((eps, parts), factor), bias) in eps.zip(parts.as_chunks().0).zip(factor).zip(bias) {
                    let [high, low] = parts.map(|sum: i32| sum as f32);
                    *eps = (high * 128.0 + low) * (factor * last_scale) + bias;
                }
            }
        }
    }
}

/// Puts values into codes, the largest magnitude at the highest code; returns
/// the rescale of a sum over them, `unit` times that magnitude.
fn encode(values: impl Iterator<Item = f32> + Clone, unit: f32, codes: &mut [i16]) -> Result<i32, NotFinite> {
    let mut largest = 0.0f32;
    for value in values.clone() {
        if !value.is_finite() {
            return Err(NotFinite);
        }
        largest = largest.max(value.abs());
    }
    let factor = f32::from(i16::MAX) / largest;
    for (code, value) in codes.iter_mut().zip(values) {
        *code = long_code(value, factor);
    }
    // A cast of what is too large takes the largest integer.
    Ok((largest * unit) as i32)
}

/// Adds a part of layer 1 that is computed once an action.
fn add_rows(
    (kernel, layout): (Kernel, Layout),
    rows: &Rows<'_>,
    codes: &[i16],
    unit: i32,
    sums: &mut [i32],
    out: &mut [i32],
) {
    let sums = front(sums, out.len());
    kernel.sum_rows(layout, rows.weights, codes, LONG_BITS, sums);
    for ((out, sum), multiplier) in out.iter_mut().zip(sums).zip(rows.multiplier) {
        *out += rescale(*sum, LONG_BITS, *multiplier, unit);
    }
}
