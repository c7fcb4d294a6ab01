//! A second opinion on the controller: the chain of an image, from the
//! paper's formulas and the image's sections, with no code of `armor-infer`.
//!
//! A policy in single precision is evaluated in f64, and agrees to rounding. A
//! policy in integers is evaluated in wide integers, and in f32 where
//! `docs/numerics.md` says so; it agrees in every bit. Only the noise is
//! shared, for it is addressed and not computed.

mod critic;
mod float;
mod integer;

use armor_core::image::{Network, PolicyImage};
use armor_core::noise::Noise;
use armor_core::units::Cost;
use armor_infer::STREAMS;
use serde::Serialize;

pub use critic::{CriticReference, Estimate};
use float::FloatReference;
use integer::IntegerReference;

/// An image's network and chains.
pub enum Reference {
    /// In f64, for a policy in single precision.
    Float(Box<FloatReference>),
    /// Bit for bit, for a policy in integers.
    Integer(Box<IntegerReference>),
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
        match &image.sections().network {
            Network::Float(network) => Self::Float(FloatReference::new(image, network).into()),
            Network::Integer(network) => Self::Integer(IntegerReference::new(image, network).into()),
        }
    }

    /// The largest difference of an action entry that is put down to the
    /// number format: single precision rounds, integers are exact.
    pub const fn tolerance(&self) -> f64 {
        match self {
            Self::Float(_) => 1e-4,
            Self::Integer(_) => 0.0,
        }
    }

    /// The chain of `rung` that a controller of `seed` flies at control step
    /// `tick`, from a state `[S]` and what is left of its budget.
    ///
    /// # Panics
    /// Where the image has no such rung, or the state not its length.
    pub fn chain(&self, rung: usize, state: &[f32], kappa: Cost, seed: u64, tick: u64) -> Chain {
        self.candidate(0, rung, state, kappa, [seed, tick])
    }

    /// As [`Reference::chain`], of one of the candidates that the best is chosen of.
    fn candidate(&self, index: u32, rung: usize, state: &[f32], kappa: Cost, place: [u64; 2]) -> Chain {
        let first = index * STREAMS;
        match self {
            Self::Float(reference) => reference.chain(rung, state, kappa, place, first),
            Self::Integer(reference) => reference.chain(rung, state, kappa, place, first),
        }
    }

    /// The actions that a controller of the best of `count` chooses from, and
    /// what `critic` says of each; otherwise as [`Reference::chain`].
    pub fn candidates(
        &self,
        (critic, count): (&CriticReference, u32),
        rung: usize,
        state: &[f32],
        kappa: Cost,
        place: [u64; 2],
    ) -> Vec<(Vec<f64>, Estimate)> {
        let candidate = |index| {
            let Chain { state_normalized, action, .. } = self.candidate(index, rung, state, kappa, place);
            let estimate = critic.estimate(&state_normalized, kappa.to_f32().into(), &action);
            (action, estimate)
        };
        (0..count).map(candidate).collect()
    }
}

/// The standard normal draws of a stream at a control step `[A]`.
fn draws(entries: usize, seed: u64, stream: u32, tick: u64) -> Vec<f32> {
    let mut draws = vec![0.0; entries];
    Noise::new(seed).fill_normal(stream, tick, &mut draws);
    draws
}

#[cfg(test)]
mod tests;
