//! The critic of an image: by what one of several actions is chosen.
//!
//! It is that of the training (section 3.2, Eq. 2) without the short-term
//! heads, in single precision whatever the policy's precision is:
//!
//! ```text
//! h      = mish(W_2 mish(W_1 [s; kappa_scale kappa; a] + b_1) + b_2)
//! Q_f,i  = w_f,i mish(W_f,i h + b_f,i) + v_f,i         f in {r, L}, i in {1, 2}
//! ```

use super::ImageError;
use super::manifest::{Manifest, SectionKind};
use super::reader::Reader;
use super::sections::Dense;

/// Largest width of the critic's layers.
pub const MAX_CRITIC_WIDTH: usize = 1024;

/// Twin estimates of the reward and of the long-term cost of an action, in place.
#[derive(Clone, Copy, Debug)]
pub struct Critic<'a> {
    /// The trunk sees `kappa_scale * kappa`; 0 where it does not see the budget.
    pub kappa_scale: f32,
    /// What one unit of cost is in the estimates of cost, above 0.
    pub cost_unit: f32,
    /// Normalised state's part of the trunk's first layer, `S x T`, and the bias.
    pub trunk_state: Dense<'a>,
    /// The budget's part `[T]`.
    pub trunk_kappa: &'a [f32],
    /// The action's part, `A x T`.
    pub trunk_action: &'a [f32],
    /// The trunk's second layer, `T x T`.
    pub trunk_2: Dense<'a>,
    /// The heads of the reward's twins.
    pub reward: [CriticHead<'a>; 2],
    /// The heads of the long-term cost's twins.
    pub cost: [CriticHead<'a>; 2],
}

/// A head: a hidden layer and one output.
#[derive(Clone, Copy, Debug)]
pub struct CriticHead<'a> {
    /// Hidden layer, `T x D`.
    pub hidden: Dense<'a>,
    /// Output layer, `D x 1`.
    pub output: Dense<'a>,
}

impl<'a> Critic<'a> {
    /// Words in front of the layers: `T`, `D`, `kappa_scale`, `cost_unit`.
    pub const HEADER_WORDS: usize = 4;

    /// The critic, if the table names it.
    pub(super) fn read(manifest: &Manifest<'_>, reader: &mut Reader<'_, 'a>) -> Result<Option<Self>, ImageError> {
        let kind = SectionKind::Critic;
        if !reader.is_next(kind) {
            return Ok(None);
        }
        let words = reader.words(kind, None)?;
        let (&[trunk, head, kappa_scale, cost_unit], layers) =
            words.split_first_chunk().ok_or(ImageError::Section(kind))?;
        let (kappa_scale, cost_unit) = (f32::from_bits(kappa_scale), f32::from_bits(cost_unit));
        let widths = [trunk, head].map(|width| width as usize);
        let is_in_range = widths.iter().all(|width| (1..=MAX_CRITIC_WIDTH).contains(width));
        // No comparison holds for a NaN.
        if !(is_in_range && (0.0..=f32::MAX).contains(&kappa_scale) && cost_unit > 0.0 && cost_unit <= f32::MAX) {
            return Err(ImageError::OutOfRange(kind));
        }
        let [t, d] = widths;
        let [s, a] = [manifest.shape.state, manifest.shape.action].map(usize::from);
        let mut layers = Layers(bytemuck::cast_slice(layers));
        // In the order of the layers' numbers: weights input by input, then the bias.
        let (of_state, trunk_kappa, trunk_action) = (layers.take(s * t)?, layers.take(t)?, layers.take(a * t)?);
        let critic = Self {
            kappa_scale,
            cost_unit,
            trunk_state: Dense { weights: of_state, bias: layers.take(t)? },
            trunk_kappa,
            trunk_action,
            trunk_2: layers.dense(t, t)?,
            reward: [layers.head(t, d)?, layers.head(t, d)?],
            cost: [layers.head(t, d)?, layers.head(t, d)?],
        };
        if layers.0.is_empty() { Ok(Some(critic)) } else { Err(ImageError::Section(kind)) }
    }

    /// Width of the trunk, `T`.
    pub const fn trunk_width(&self) -> usize {
        self.trunk_kappa.len()
    }

    /// Width of a head's hidden layer, `D`.
    pub const fn head_width(&self) -> usize {
        self.reward[0].hidden.bias.len()
    }
}

/// What is left of the section's numbers.
struct Layers<'a>(&'a [f32]);

impl<'a> Layers<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [f32], ImageError> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or(ImageError::Section(SectionKind::Critic))?;
        self.0 = rest;
        if taken.iter().any(|value| !value.is_finite()) {
            return Err(ImageError::NotFinite(SectionKind::Critic));
        }
        Ok(taken)
    }

    fn dense(&mut self, inputs: usize, outputs: usize) -> Result<Dense<'a>, ImageError> {
        Ok(Dense { weights: self.take(inputs * outputs)?, bias: self.take(outputs)? })
    }

    fn head(&mut self, inputs: usize, hidden: usize) -> Result<CriticHead<'a>, ImageError> {
        Ok(CriticHead { hidden: self.dense(inputs, hidden)?, output: self.dense(hidden, 1)? })
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{Aligned, Parts, SHAPE};
    use super::super::{PolicyImage, SECTION_COUNT};
    use super::*;
    use std::vec::Vec;

    const TRUNK: usize = 4;
    const HEAD: usize = 3;

    /// Every number is its own.
    fn with_critic() -> Parts {
        let (s, a) = (usize::from(SHAPE.state), usize::from(SHAPE.action));
        let numbers = (s + 1 + a + 1) * TRUNK + (TRUNK + 1) * TRUNK + 4 * ((TRUNK + 1) * HEAD + HEAD + 1);
        let mut parts = Parts::new(SHAPE);
        *parts.section(SectionKind::Critic) = [TRUNK as u32, HEAD as u32, 0.5f32.to_bits(), 2f32.to_bits()]
            .into_iter()
            .chain((0..numbers).map(|i| (i as f32).to_bits()))
            .collect();
        parts
    }

    fn fault(change: impl FnOnce(&mut Vec<u32>)) -> ImageError {
        let mut parts = with_critic();
        change(parts.section(SectionKind::Critic));
        parts.fault()
    }

    #[test]
    fn a_critic_is_read_back_in_the_order_of_its_layers() {
        let (mut memory, _): (Aligned, usize) = with_critic().build();
        let image = PolicyImage::new_checked(memory.bytes()).unwrap();
        // The budget map is left out.
        assert_eq!(image.manifest().sections.len(), SECTION_COUNT - 1);
        let critic = image.critic().unwrap();
        assert_eq!((critic.kappa_scale, critic.cost_unit), (0.5, 2.0));
        assert_eq!((critic.trunk_width(), critic.head_width()), (TRUNK, HEAD));
        let heads = critic.reward.iter().chain(&critic.cost);
        let heads =
            heads.flat_map(|head| [head.hidden.weights, head.hidden.bias, head.output.weights, head.output.bias]);
        let trunk = [critic.trunk_state.weights, critic.trunk_kappa, critic.trunk_action, critic.trunk_state.bias];
        let read: Vec<f32> = trunk
            .into_iter()
            .chain([critic.trunk_2.weights, critic.trunk_2.bias])
            .chain(heads)
            .flatten()
            .copied()
            .collect();
        assert!(read.iter().enumerate().all(|(i, &number)| number == i as f32));
        assert_eq!(read.len() + Critic::HEADER_WORDS, image.words(SectionKind::Critic).len());
        let lengths = [critic.trunk_state.weights, critic.trunk_kappa, critic.trunk_action].map(<[f32]>::len);
        assert_eq!(lengths, [3 * TRUNK, TRUNK, 2 * TRUNK]);

        let (mut memory, _) = Parts::new(SHAPE).build();
        assert!(PolicyImage::new_checked(memory.bytes()).unwrap().critic().is_none());
    }

    #[test]
    fn a_critic_out_of_shape_or_range_is_named() {
        let section = ImageError::Section(SectionKind::Critic);
        assert_eq!(fault(|words| words.truncate(3)), section);
        assert_eq!(fault(|words| words.push(0)), section);
        assert_eq!(fault(|words| words.truncate(words.len() - 1)), section);
        assert_eq!(fault(|words| words[0] += 1), section);
        for (word, bad) in [(0, 0), (1, 0), (0, 1025), (1, u32::MAX)] {
            assert_eq!(fault(|words| words[word] = bad), ImageError::OutOfRange(SectionKind::Critic));
        }
        for (word, bad) in [(2, -0.5), (2, f32::NAN), (2, f32::INFINITY), (3, 0.0), (3, -1.0), (3, f32::NAN)] {
            assert_eq!(fault(|words| words[word] = bad.to_bits()), ImageError::OutOfRange(SectionKind::Critic));
        }
        for word in Critic::HEADER_WORDS..20 {
            assert_eq!(fault(|words| words[word] = f32::NAN.to_bits()), ImageError::NotFinite(SectionKind::Critic));
        }
    }
}
