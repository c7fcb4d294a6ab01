//! The denoiser of an image, in the number format of its precision.

use super::ImageError;
use super::layout::Layout;
use super::manifest::{Manifest, SectionKind};
use super::reader::Reader;
use super::sections::Dense;
use crate::fixed::{MAX_BIAS, MAX_TERMS};

/// The denoiser's numbers, in place; lengths follow from the shape.
#[derive(Clone, Copy, Debug)]
pub enum Network<'a> {
    /// Single precision throughout.
    Float(FloatNetwork<'a>),
    /// 8-bit weights and integer activations, [`crate::fixed`].
    Integer(IntegerNetwork<'a>),
}

/// A denoiser in single precision.
#[derive(Clone, Copy, Debug)]
pub struct FloatNetwork<'a> {
    /// State part of layer 1, `S x H`, and its bias.
    pub context_state: Dense<'a>,
    /// Kappa part of layer 1, `E x H`.
    pub context_kappa: &'a [f32],
    /// Time part of layer 1, `N x H`; row `n - 1` for noise level `n`.
    pub time_table: &'a [f32],
    /// Action part of layer 1, `A x H`.
    pub action_input: &'a [f32],
    /// Layer 2, `H x H`.
    pub hidden_2: Dense<'a>,
    /// Layer 3, `H x H`.
    pub hidden_3: Dense<'a>,
    /// Output layer, `H x A`.
    pub output: Dense<'a>,
}

/// A denoiser in fixed point; biases are pre-activations.
#[derive(Clone, Copy, Debug)]
pub struct IntegerNetwork<'a> {
    /// State part of layer 1, `H` rows of `S`.
    pub context_state: Rows<'a>,
    /// Kappa part of layer 1, `H` rows of `E`.
    pub context_kappa: Rows<'a>,
    /// Bias of layer 1 `[H]`.
    pub context_bias: &'a [i32],
    /// Time part of layer 1, `N x H`, to be shifted left by [`IntegerNetwork::time_shift`].
    pub time_table: &'a [i16],
    /// Action part of layer 1, `A x H`; a product is shifted right by [`IntegerNetwork::action_shift`].
    pub action_input: &'a [i16],
    /// Layer 2, `H` rows of `H`.
    pub hidden_2: Rows<'a>,
    /// Bias of layer 2 `[H]`.
    pub bias_2: &'a [i32],
    /// Layer 3, `H` rows of `H`.
    pub hidden_3: Rows<'a>,
    /// Bias of layer 3 `[H]`.
    pub bias_3: &'a [i32],
    /// Output layer, `2 A` rows of `H` in the network's layout: for each output
    /// the high part of its weights, in steps of 128, then the low part.
    pub output: &'a [i8],
    /// Factor of each output's sum `[A]`.
    pub output_factor: &'a [f32],
    /// Bias of each output `[A]`.
    pub output_bias: &'a [f32],
    /// Rescale of the state part for states whose largest entry is 1.
    pub state_unit: f32,
    /// Rescale of the kappa part for embeddings whose largest entry is 1.
    pub kappa_unit: f32,
    /// Codes in 1 of a noisy action.
    pub action_factor: f32,
    /// Shift of the time table, 0 to 8.
    pub time_shift: u32,
    /// Shift of the products with a noisy action, 8 to 16.
    pub action_shift: u32,
    /// Order of the weights.
    pub layout: Layout,
    levels: &'a [[u32; LevelScales::WORDS]],
}

/// The weights of an integer layer and the multiplier of each of its rows.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'a> {
    /// In the network's layout, an 8-bit weight for each row and input.
    pub weights: &'a [i8],
    /// What [`crate::fixed::rescale`] multiplies a row's sum by, positive.
    pub multiplier: &'a [i32],
}

/// The scales of the hidden layers at one noise level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelScales {
    /// What [`crate::fixed::activate`] multiplies the activations of layers 1, 2 and 3 by.
    pub activate: [i32; 3],
    /// What [`crate::fixed::rescale`] multiplies the sums of layers 2 and 3 by.
    pub rescale: [i32; 2],
    /// What one code of layer 3 stands for.
    pub last_scale: f32,
}

impl LevelScales {
    /// Words of a level in an image.
    pub const WORDS: usize = 6;

    /// The scales as they stand in an image.
    pub const fn to_words(self) -> [u32; Self::WORDS] {
        let ([a, b, c], [d, e]) = (self.activate, self.rescale);
        [a as u32, b as u32, c as u32, d as u32, e as u32, self.last_scale.to_bits()]
    }

    /// The inverse of [`LevelScales::to_words`].
    pub const fn from_words([a, b, c, d, e, last]: [u32; Self::WORDS]) -> Self {
        Self {
            activate: [a as i32, b as i32, c as i32],
            rescale: [d as i32, e as i32],
            last_scale: f32::from_bits(last),
        }
    }
}

/// Words of the Scales section before its levels.
const SCALES_HEADER: usize = 5;

impl<'a> IntegerNetwork<'a> {
    /// The scales at noise level `n`, 1 to `N`; none beyond.
    pub fn level(&self, n: usize) -> Option<LevelScales> {
        self.levels.get(n.checked_sub(1)?).map(|words| LevelScales::from_words(*words))
    }

    pub(super) fn read(manifest: &Manifest<'_>, reader: &mut Reader<'_, 'a>) -> Result<Self, ImageError> {
        let [s, a, h, e, n] = {
            let shape = &manifest.shape;
            [shape.state, shape.action, shape.hidden, shape.kappa_embedding, shape.steps].map(usize::from)
        };
        if s.max(h).max(e) > MAX_TERMS {
            return Err(ImageError::Shape);
        }
        let layout = manifest.layout;
        let (s_bytes, e_bytes, h_bytes) = (layout.bytes(h, s), layout.bytes(h, e), layout.bytes(h, h));
        let output_bytes = layout.bytes(2 * a, h);
        let of_state = bytes(s_bytes) + h;
        let context = reader.words(SectionKind::Context, Some(of_state + bytes(e_bytes) + h + h))?;
        let (of_state, rest) = context.split_at_checked(of_state).unwrap_or_default();
        let (of_kappa, bias) = rest.split_at_checked(bytes(e_bytes) + h).unwrap_or_default();
        let context_state = rows(SectionKind::Context, of_state, s_bytes)?;
        let context_kappa = rows(SectionKind::Context, of_kappa, e_bytes)?;
        let context_bias = biases(SectionKind::Context, bias)?;
        let time_table = shorts(reader.words(SectionKind::TimeTable, Some(halves(n * h)))?, n * h);
        let action_input = shorts(reader.words(SectionKind::ActionInput, Some(halves(a * h)))?, a * h);
        let mut hidden = |kind| {
            let words = reader.words(kind, Some(bytes(h_bytes) + 2 * h))?;
            let (matrix, bias) = words.split_at_checked(bytes(h_bytes) + h).unwrap_or_default();
            Ok((rows(kind, matrix, h_bytes)?, biases(kind, bias)?))
        };
        let (hidden_2, bias_2) = hidden(SectionKind::Hidden2)?;
        let (hidden_3, bias_3) = hidden(SectionKind::Hidden3)?;
        let output = reader.words(SectionKind::Output, Some(bytes(output_bytes) + 2 * a))?;
        let (weights, factors) = output.split_at_checked(bytes(output_bytes)).unwrap_or_default();
        let (output_factor, output_bias) =
            floats(SectionKind::Output, factors)?.split_at_checked(a).unwrap_or_default();

        let kind = SectionKind::Scales;
        let scales = reader.words(kind, Some(SCALES_HEADER + n * LevelScales::WORDS))?;
        let (&[state_unit, kappa_unit, action_factor, time_shift, action_shift], levels) =
            scales.split_first_chunk().ok_or(ImageError::Section(kind))?;
        let (levels, _) = levels.as_chunks();
        let network = Self {
            context_state,
            context_kappa,
            context_bias,
            time_table,
            action_input,
            hidden_2,
            bias_2,
            hidden_3,
            bias_3,
            output: signed(weights, output_bytes),
            output_factor,
            output_bias,
            state_unit: f32::from_bits(state_unit),
            kappa_unit: f32::from_bits(kappa_unit),
            action_factor: f32::from_bits(action_factor),
            time_shift,
            action_shift,
            layout,
            levels,
        };
        if network.scales_are_in_range() { Ok(network) } else { Err(ImageError::OutOfRange(kind)) }
    }

    fn scales_are_in_range(&self) -> bool {
        let positive = |value: f32| value.is_finite() && value > 0.0;
        let units = [self.state_unit, self.kappa_unit, self.action_factor].into_iter().all(positive);
        let levels = self.levels.iter().map(|words| LevelScales::from_words(*words)).all(|level| {
            level.activate.iter().chain(&level.rescale).all(|&factor| factor > 0) && positive(level.last_scale)
        });
        units && levels && self.time_shift <= 8 && (8..=16).contains(&self.action_shift)
    }
}

/// Words that hold `count` bytes.
const fn bytes(count: usize) -> usize {
    count.div_ceil(4)
}

/// Words that hold `count` half-words.
const fn halves(count: usize) -> usize {
    count.div_ceil(2)
}

/// The first `count` bytes of words; the caller has checked that they are there.
fn signed(words: &[u32], count: usize) -> &[i8] {
    bytemuck::cast_slice::<u32, i8>(words).get(..count).unwrap_or_default()
}

/// The first `count` half-words of words; the caller has checked that they are there.
fn shorts(words: &[u32], count: usize) -> &[i16] {
    bytemuck::cast_slice::<u32, i16>(words).get(..count).unwrap_or_default()
}

/// `count` bytes of weights, then the multipliers of their rows.
fn rows(kind: SectionKind, words: &[u32], count: usize) -> Result<Rows<'_>, ImageError> {
    let (weights, multiplier) = words.split_at_checked(bytes(count)).unwrap_or_default();
    let multiplier: &[i32] = bytemuck::cast_slice(multiplier);
    if multiplier.iter().any(|&multiplier| multiplier <= 0) {
        return Err(ImageError::OutOfRange(kind));
    }
    Ok(Rows { weights: signed(weights, count), multiplier })
}

fn biases(kind: SectionKind, words: &[u32]) -> Result<&[i32], ImageError> {
    let biases: &[i32] = bytemuck::cast_slice(words);
    if biases.iter().any(|bias| bias.unsigned_abs() > MAX_BIAS.unsigned_abs()) {
        return Err(ImageError::OutOfRange(kind));
    }
    Ok(biases)
}

fn floats(kind: SectionKind, words: &[u32]) -> Result<&[f32], ImageError> {
    let floats: &[f32] = bytemuck::cast_slice(words);
    if floats.iter().any(|value| !value.is_finite()) {
        return Err(ImageError::NotFinite(kind));
    }
    Ok(floats)
}

impl<'a> FloatNetwork<'a> {
    pub(super) fn read(manifest: &Manifest<'_>, reader: &mut Reader<'_, 'a>) -> Result<Self, ImageError> {
        let [s, a, h, e, n] = {
            let shape = &manifest.shape;
            [shape.state, shape.action, shape.hidden, shape.kappa_embedding, shape.steps].map(usize::from)
        };
        let (matrices, context_bias) = reader.pair(SectionKind::Context, (s + e) * h, h)?;
        let (state_weights, context_kappa) = matrices.split_at_checked(s * h).unwrap_or_default();
        let network = Self {
            context_state: Dense { weights: state_weights, bias: context_bias },
            context_kappa,
            time_table: reader.floats(SectionKind::TimeTable, n * h)?,
            action_input: reader.floats(SectionKind::ActionInput, a * h)?,
            hidden_2: reader.dense(SectionKind::Hidden2, h, h)?,
            hidden_3: reader.dense(SectionKind::Hidden3, h, h)?,
            output: reader.dense(SectionKind::Output, h, a)?,
        };
        reader.words(SectionKind::Scales, Some(0))?;
        Ok(network)
    }
}
