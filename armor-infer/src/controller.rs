//! The control loop of section 3.5.
//!
//! Responsibilities, at every control step:
//! - charge the cost that the last action incurred to the budget;
//! - answer the sensed state with an action within the policy's bounds,
//!   whatever the state, the cost and the weights are;
//! - name the fault, if there was one.
//!
//! Important terms:
//! - *limit*: the cost that an episode may incur, `d` of Eq. 1;
//! - *kappa*: what is left of it; `d` at the start, then
//!   `max(0, kappa - cost)` after each step, and nothing but a new episode
//!   refills it;
//! - *incurred*: the cost of the step before, as the robot reports it;
//! - *tick*: the control step of the episode, from 0; with the seed it
//!   addresses the noise, so a step can be repeated bit for bit;
//! - *rung*: one of the image's chains; a shorter one answers sooner and worse;
//! - *fallback*: the action that the image names for when none can be computed;
//! - *fault*: why the step was not an ordinary one.

use core::fmt;
use core::mem::MaybeUninit;

use armor_core::units::{Cost, CostLimit};
use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use crate::control_loop::ControlLoop;
use crate::denoiser::NotFinite;
use crate::policy::{LoadError, Policy};

/// A policy in flight: its numbers in flash, its budget, and all the memory it works in.
///
/// The capacities are the largest state and action vectors and the widest
/// layer of the policies that it may be given.
pub struct Controller<'a, const STATE: usize, const ACTION: usize, const HIDDEN: usize>(
    ControlLoop<'a, STATE, ACTION, HIDDEN, 1>,
);

/// The answer to a control step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step<const ACTION: usize> {
    /// What to do, within the policy's bounds; entries beyond its action dimension are 0.
    pub action: SVector<f32, ACTION>,
    /// The budget left after the incurred cost was charged.
    pub kappa: Cost,
    /// Which of the image's chains flew; none where the action is the fallback.
    pub rung: Option<usize>,
    /// Why the step was not an ordinary one.
    ///
    /// Where two faults coincide, the one that decided the action is named: the
    /// other can only be [`Fault::InvalidCost`], and `kappa` is 0 then.
    pub fault: Option<Fault>,
}

/// Why a control step was not an ordinary one.
///
/// The order of the variants is the link's: a new one goes to the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Fault {
    /// The state has not the policy's length; the action is the fallback.
    StateLength,
    /// The state holds a NaN or an infinity; the action is the fallback.
    StateNotFinite,
    /// The incurred cost was negative, NaN or infinite. The whole budget was
    /// charged, and the action is the policy's at kappa 0.
    InvalidCost,
    /// Every chain of the policy takes more steps than the call allowed; the
    /// action is the fallback.
    NoRung,
    /// The network met or answered a NaN or an infinity; the action is the fallback.
    ActionNotFinite,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::StateLength => "state has the wrong length; the fallback action was taken, check the sensors' layout",
            Self::StateNotFinite => "state is not finite; the fallback action was taken, check the sensors",
            Self::InvalidCost => "incurred cost is no cost; the whole budget was charged, check the cost monitor",
            Self::NoRung => "no chain is as short as allowed; the fallback action was taken, export a shorter rung",
            Self::ActionNotFinite => {
                "the network's answer is not finite; the fallback action was taken, check the state's range"
            }
        })
    }
}

impl From<NotFinite> for Fault {
    fn from(_: NotFinite) -> Self {
        Self::ActionNotFinite
    }
}

impl<'a, const STATE: usize, const ACTION: usize, const HIDDEN: usize> Controller<'a, STATE, ACTION, HIDDEN> {
    /// All the memory that a controller takes, in bytes.
    pub const RAM_BYTES: usize = size_of::<Self>();

    /// A controller at the start of an episode of the given limit; `seed`
    /// decides the noise of all its chains.
    ///
    /// # Errors
    /// [`LoadError`] if the policy does not fit the capacities, or the limit
    /// exceeds the budgets that it was trained with.
    pub fn new(policy: Policy<'a>, limit: CostLimit, seed: u64) -> Result<Self, LoadError> {
        ControlLoop::new(policy, limit, seed).map(Self)
    }

    /// As [`Controller::new`], in place: on a stack that is too small for a controller.
    ///
    /// # Errors
    /// [`LoadError`], as there; nothing was written then.
    pub fn new_in<'p>(
        place: &'p mut MaybeUninit<Self>,
        policy: Policy<'a>,
        limit: CostLimit,
        seed: u64,
    ) -> Result<&'p mut Self, LoadError> {
        ControlLoop::<STATE, ACTION, HIDDEN, 1>::admit(&policy, limit)?;
        let controller = place.write(Self::idle(policy));
        controller.start(limit, seed);
        Ok(controller)
    }

    /// A controller whose memory does not suit its policy yet.
    #[inline(always)]
    pub(crate) const fn idle(policy: Policy<'a>) -> Self {
        Self(ControlLoop::idle(policy))
    }

    /// The start of the first episode.
    pub(crate) fn start(&mut self, limit: CostLimit, seed: u64) {
        self.0.start(limit, seed);
    }

    /// Starts a new episode: the only way to refill the budget.
    ///
    /// # Errors
    /// [`LoadError::LimitAboveTrainedRange`]; the episode before goes on then.
    pub fn new_episode(&mut self, limit: CostLimit, seed: u64) -> Result<(), LoadError> {
        self.0.new_episode(limit, seed)
    }

    /// One control step: charges `incurred`, the cost of the step before (0 on
    /// the first), then answers `state` `[S]` with an action, by the policy's
    /// longest chain.
    pub fn step(&mut self, state: &[f32], incurred: f32) -> Step<ACTION> {
        self.step_within(state, incurred, usize::MAX)
    }

    /// As [`Controller::step`], by the longest chain of at most `steps` calls
    /// of the denoiser: the caller knows how many its deadline leaves time for.
    pub fn step_within(&mut self, state: &[f32], incurred: f32, steps: usize) -> Step<ACTION> {
        self.0.step(state, incurred, steps, |_| Ok(0))
    }

    /// What is left of the budget.
    pub const fn kappa(&self) -> Cost {
        self.0.kappa()
    }
}

/// The largest shape that a small microcontroller is meant to hold.
const _: () = assert!(Controller::<96, 8, 256>::RAM_BYTES <= 6 * 1024);

#[cfg(test)]
mod tests;
