//! The numbers of an image, as slices into its bytes.

use super::ImageError;
use super::critic::Critic;
use super::golden::GoldenTrace;
use super::manifest::{Manifest, Precision, SectionKind};
use super::network::{FloatNetwork, IntegerNetwork, Network};
use super::reader::Reader;
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
    /// The denoiser.
    pub network: Network<'a>,
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

    /// The sections of a policy, and its critic where there is one.
    pub(super) fn read(manifest: &Manifest<'_>, body: &'a [u8]) -> Result<(Self, Option<Critic<'a>>), ImageError> {
        let [s, a, k, e] = {
            let shape = &manifest.shape;
            [shape.state, shape.action, shape.kappa_hidden, shape.kappa_embedding].map(usize::from)
        };
        let mut reader = Reader::new(manifest, body);

        let (state_mean, state_factor) = reader.pair(SectionKind::StateNormaliser, s, s)?;
        let (action_low, rest) = reader.pair(SectionKind::ActionBounds, a, 2 * a)?;
        let (action_high, action_fallback) = rest.split_at_checked(a).unwrap_or_default();
        let kappa = [
            reader.dense(SectionKind::Kappa1, 1, k)?,
            reader.dense(SectionKind::Kappa2, k, k)?,
            reader.dense(SectionKind::Kappa3, k, e)?,
        ];
        let network = match manifest.precision {
            Precision::F32 => Network::Float(FloatNetwork::read(manifest, &mut reader)?),
            Precision::Int16x8 | Precision::Int8 => Network::Integer(IntegerNetwork::read(manifest, &mut reader)?),
        };
        let chain_steps = manifest.rungs.iter().map(|rung| usize::from(rung.steps)).sum::<usize>();
        let chain = reader.words(SectionKind::Chain, Some(chain_steps * ChainStep::WORDS))?;
        let golden = GoldenTrace::read(reader.words(SectionKind::Golden, None)?, s, a)?;
        let budget_map = reader.budget_map()?;
        let critic = Critic::read(manifest, &mut reader)?;
        reader.finish()?;

        let (chain, _) = chain.as_chunks();
        let sections = Self {
            state_mean,
            state_factor,
            action_low,
            action_high,
            action_fallback,
            kappa,
            network,
            golden,
            budget_map,
            chain,
        };
        sections.check_bounds()?;
        sections.check_chains(manifest)?;
        Ok((sections, critic))
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
