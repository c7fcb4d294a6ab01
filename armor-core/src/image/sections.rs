//! The numbers of an image, as slices into its bytes.

use super::golden::GoldenTrace;
use super::manifest::{Manifest, SectionKind};
use super::{ALIGNMENT, ImageError};
use crate::budget_map::BudgetMap;
use crate::schedule::ChainStep;

#[cfg(target_endian = "big")]
compile_error!("policy images are read in place and are little-endian");

/// A layer: `weights` from `I` inputs to `O` outputs, input by input; `bias` `[O]`.
#[derive(Clone, Copy, Debug)]
pub struct Dense<'a> {
    /// `I * O` weights; those of input `i` are `[i * O .. (i + 1) * O]`.
    pub weights: &'a [f32],
    /// `O` biases.
    pub bias: &'a [f32],
}

/// Every number of an image, in place; lengths follow from the shape.
#[derive(Clone, Copy, Debug)]
pub struct Sections<'a> {
    /// Mean of each state entry `[S]`.
    pub state_mean: &'a [f32],
    /// Factor of each centred state entry `[S]`.
    pub state_factor: &'a [f32],
    /// Smallest action `[A]`.
    pub action_low: &'a [f32],
    /// Largest action `[A]`.
    pub action_high: &'a [f32],
    /// What to do when no action can be computed `[A]`, within the bounds.
    pub action_fallback: &'a [f32],
    /// The kappa embedding, `1 -> K -> K -> E`.
    pub kappa: [Dense<'a>; 3],
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
    /// The golden trace.
    pub golden: GoldenTrace<'a>,
    /// What the policy is conditioned on at a budget; none where that is the budget itself.
    pub budget_map: Option<BudgetMap<'a>>,
    chain: &'a [[u32; ChainStep::WORDS]],
}

impl<'a> Sections<'a> {
    /// The steps of rung `index`; none if there is no such rung.
    pub fn chain(&self, manifest: &Manifest<'_>, index: usize) -> impl ExactSizeIterator<Item = ChainStep> + use<'a> {
        self.chain_words(manifest, index).iter().map(|words| ChainStep::from_words(*words))
    }

    /// The steps of rung `index` as they stand in the image
    /// ([`ChainStep::to_words`]); empty if there is no such rung.
    pub fn chain_words(&self, manifest: &Manifest<'_>, index: usize) -> &'a [[u32; ChainStep::WORDS]] {
        let steps = |rung: &super::Rung| usize::from(rung.steps);
        let first: usize = manifest.rungs.iter().take(index).map(steps).sum();
        let length = manifest.rungs.get(index).map_or(0, steps);
        self.chain.get(first..).and_then(|rest| rest.get(..length)).unwrap_or_default()
    }

    pub(super) fn read(manifest: &Manifest<'_>, body: &'a [u8]) -> Result<Self, ImageError> {
        let [s, a, h, k, e, n] = {
            let shape = &manifest.shape;
            [shape.state, shape.action, shape.hidden, shape.kappa_hidden, shape.kappa_embedding, shape.steps]
                .map(usize::from)
        };
        let mut reader = Reader { manifest, body, next: 0, end: 0 };

        let (state_mean, state_factor) = reader.pair(SectionKind::StateNormaliser, s, s)?;
        let (action_low, rest) = reader.pair(SectionKind::ActionBounds, a, 2 * a)?;
        let (action_high, action_fallback) = rest.split_at_checked(a).unwrap_or_default();
        let kappa = [
            reader.dense(SectionKind::Kappa1, 1, k)?,
            reader.dense(SectionKind::Kappa2, k, k)?,
            reader.dense(SectionKind::Kappa3, k, e)?,
        ];
        let (matrices, context_bias) = reader.pair(SectionKind::Context, (s + e) * h, h)?;
        let (state_weights, context_kappa) = matrices.split_at_checked(s * h).unwrap_or_default();
        let time_table = reader.floats(SectionKind::TimeTable, n * h)?;
        let action_input = reader.floats(SectionKind::ActionInput, a * h)?;
        let hidden_2 = reader.dense(SectionKind::Hidden2, h, h)?;
        let hidden_3 = reader.dense(SectionKind::Hidden3, h, h)?;
        let output = reader.dense(SectionKind::Output, h, a)?;
        let chain_steps = manifest.rungs.iter().map(|rung| usize::from(rung.steps)).sum::<usize>();
        let chain = reader.words(SectionKind::Chain, Some(chain_steps * ChainStep::WORDS))?;
        let golden = GoldenTrace::read(reader.words(SectionKind::Golden, None)?, s, a)?;
        let budget_map = reader.budget_map()?;
        reader.finish()?;

        let (chain, _) = chain.as_chunks();
        let sections = Self {
            state_mean,
            state_factor,
            action_low,
            action_high,
            action_fallback,
            kappa,
            context_state: Dense { weights: state_weights, bias: context_bias },
            context_kappa,
            time_table,
            action_input,
            hidden_2,
            hidden_3,
            output,
            golden,
            budget_map,
            chain,
        };
        sections.check_bounds()?;
        sections.check_chains(manifest)?;
        Ok(sections)
    }

    fn check_bounds(&self) -> Result<(), ImageError> {
        let bounds = self.action_low.iter().zip(self.action_high).zip(self.action_fallback);
        for ((low, high), fallback) in bounds {
            if !(low <= fallback && fallback <= high) {
                return Err(ImageError::Bounds);
            }
        }
        Ok(())
    }

    /// Every chain goes down from level to level, and its last step is the estimate itself.
    fn check_chains(&self, manifest: &Manifest<'_>) -> Result<(), ImageError> {
        for index in 0..manifest.rungs.len() {
            let mut level = usize::from(manifest.shape.steps) + 1;
            let mut last = None;
            for step in self.chain(manifest, index) {
                let coefficients = [step.from_action, step.from_noise, step.to_x0, step.to_action, step.sigma];
                if step.n == 0 || step.n >= level || coefficients.iter().any(|c| !c.is_finite()) {
                    return Err(ImageError::Chain);
                }
                level = step.n;
                last = Some((step.to_x0, step.to_action, step.sigma));
            }
            if last != Some((1.0, 0.0, 0.0)) {
                return Err(ImageError::Chain);
            }
        }
        Ok(())
    }
}

/// Takes the sections from the body, one after the other.
struct Reader<'m, 'a> {
    manifest: &'m Manifest<'m>,
    body: &'a [u8],
    /// Index of the next section in the table.
    next: usize,
    /// Where the last section ended.
    end: usize,
}

impl<'a> Reader<'_, 'a> {
    /// The words of the next section, which must be `kind` and, where given, hold `count` words.
    fn words(&mut self, kind: SectionKind, count: Option<usize>) -> Result<&'a [u32], ImageError> {
        let error = ImageError::Section(kind);
        let section = self.manifest.sections.get(self.next).ok_or(error)?;
        let (offset, length) = (section.offset as usize, section.length as usize);
        if section.kind != kind || offset != self.end.next_multiple_of(ALIGNMENT) {
            return Err(error);
        }
        if count.is_some_and(|count| length != 4 * count) {
            return Err(error);
        }
        let padding = self.body.get(self.end..offset).ok_or(error)?;
        let bytes = self.body.get(offset..).and_then(|rest| rest.get(..length)).ok_or(error)?;
        if padding.iter().any(|&byte| byte != 0) {
            return Err(error);
        }
        self.next += 1;
        self.end = offset + length;
        bytemuck::try_cast_slice(bytes).map_err(|_| error)
    }

    fn floats(&mut self, kind: SectionKind, count: usize) -> Result<&'a [f32], ImageError> {
        let words = self.words(kind, Some(count))?;
        let floats: &[f32] = bytemuck::try_cast_slice(words).map_err(|_| ImageError::Section(kind))?;
        if floats.iter().any(|value| !value.is_finite()) {
            return Err(ImageError::NotFinite(kind));
        }
        Ok(floats)
    }

    fn pair(&mut self, kind: SectionKind, first: usize, second: usize) -> Result<(&'a [f32], &'a [f32]), ImageError> {
        self.floats(kind, first + second)?.split_at_checked(first).ok_or(ImageError::Section(kind))
    }

    fn dense(&mut self, kind: SectionKind, inputs: usize, outputs: usize) -> Result<Dense<'a>, ImageError> {
        let (weights, bias) = self.pair(kind, inputs * outputs, outputs)?;
        Ok(Dense { weights, bias })
    }

    /// The knots of the budget map, if the table names it.
    fn budget_map(&mut self) -> Result<Option<BudgetMap<'a>>, ImageError> {
        if self.manifest.sections.get(self.next).is_none_or(|section| section.kind != SectionKind::BudgetMap) {
            return Ok(None);
        }
        match self.words(SectionKind::BudgetMap, None)?.as_chunks() {
            (knots, []) => BudgetMap::new(knots).map(Some).ok_or(ImageError::BudgetMap),
            _ => Err(ImageError::Section(SectionKind::BudgetMap)),
        }
    }

    /// The last section ends where the image ends, and no section follows it.
    fn finish(&self) -> Result<(), ImageError> {
        if self.end == self.body.len() && self.next == self.manifest.sections.len() {
            Ok(())
        } else {
            Err(ImageError::Section(SectionKind::Golden))
        }
    }
}
