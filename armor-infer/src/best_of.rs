//! Best of `K`: the policy draws `K` candidates for every action, and the
//! critic of its training chooses one.
//!
//! The candidates run down the chain side by side, so that the weights of a
//! policy in single precision are read once for all of them. Those whose
//! long-term cost lies within the remaining budget compete on reward; where
//! there are none, the one of least cost wins. The reward's twins count by
//! the lesser, the cost's by the larger (Eq. 3). Of equals the first wins.
//!
//! Candidate 0 is the action that a plain controller would take.

use armor_core::image::{Critic, CriticHead, PolicyImage};
use armor_core::units::{Cost, CostLimit};

use crate::control_loop::{Candidates, ControlLoop};
use crate::controller::Step;
use crate::denoiser::{NotFinite, affine, affine_columns, front, normalised};
use crate::policy::{LoadError, Policy};

/// A [`Controller`](crate::Controller) that draws `K` candidates and takes the best.
pub struct BestOf<'a, const STATE: usize, const ACTION: usize, const HIDDEN: usize, const K: usize> {
    flight: ControlLoop<'a, STATE, ACTION, HIDDEN, K>,
    critic: Critic<'a>,
}

/// What the critic says of a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Estimate {
    reward: f32,
    /// Long-term cost, in the critic's units.
    cost: f32,
}

impl<'a, const STATE: usize, const ACTION: usize, const HIDDEN: usize, const K: usize>
    BestOf<'a, STATE, ACTION, HIDDEN, K>
{
    /// All the memory that it takes, in bytes.
    pub const RAM_BYTES: usize = size_of::<Self>();

    /// A controller of the image's policy at the start of an episode of the
    /// given limit; `seed` decides the noise of all its chains.
    ///
    /// # Errors
    /// [`LoadError`] as of [`Controller::new`](crate::Controller::new), or if
    /// the image has no critic or one with layers wider than `HIDDEN`.
    pub fn new(image: &PolicyImage<'a>, limit: CostLimit, seed: u64) -> Result<Self, LoadError> {
        let critic = *image.critic().ok_or(LoadError::NoCritic)?;
        let needed = critic.trunk_width().max(critic.head_width());
        if needed > HIDDEN {
            return Err(LoadError::HiddenCapacity { needed, capacity: HIDDEN });
        }
        Ok(Self { flight: ControlLoop::new(Policy::load(image)?, limit, seed)?, critic })
    }

    /// Starts a new episode: the only way to refill the budget.
    ///
    /// # Errors
    /// [`LoadError::LimitAboveTrainedRange`]; the episode before goes on then.
    pub fn new_episode(&mut self, limit: CostLimit, seed: u64) -> Result<(), LoadError> {
        self.flight.new_episode(limit, seed)
    }

    /// As [`Controller::step`](crate::Controller::step).
    pub fn step(&mut self, state: &[f32], incurred: f32) -> Step<ACTION> {
        self.step_within(state, incurred, usize::MAX)
    }

    /// As [`Controller::step_within`](crate::Controller::step_within).
    pub fn step_within(&mut self, state: &[f32], incurred: f32, steps: usize) -> Step<ACTION> {
        let critic = &self.critic;
        self.flight.step(state, incurred, steps, |candidates| {
            let limit = critic.cost_unit * candidates.kappa.to_f32();
            best(estimates(critic, candidates)?, limit).ok_or(NotFinite)
        })
    }

    /// What is left of the budget.
    pub const fn kappa(&self) -> Cost {
        self.flight.kappa()
    }
}

/// The best of the candidates whose estimates are finite; none where there is no such candidate.
fn best<const K: usize>(estimates: [Estimate; K], limit: f32) -> Option<usize> {
    let mut best: Option<(usize, Estimate)> = None;
    for (index, estimate) in estimates.into_iter().enumerate() {
        if !(estimate.reward.is_finite() && estimate.cost.is_finite()) {
            continue;
        }
        let is_better = |than: Estimate| match (estimate.cost <= limit, than.cost <= limit) {
            (true, true) => estimate.reward > than.reward,
            (false, false) => estimate.cost < than.cost,
            (within, _) => within,
        };
        if best.is_none_or(|(_, than)| is_better(than)) {
            best = Some((index, estimate));
        }
    }
    best.map(|(index, _)| index)
}

/// Runs the critic on all candidates at once.
fn estimates<const STATE: usize, const HIDDEN: usize, const K: usize>(
    critic: &Critic<'_>,
    candidates: Candidates<'_, '_, STATE, HIDDEN, K>,
) -> Result<[Estimate; K], NotFinite> {
    let Candidates { policy, state, kappa, actions, memory } = candidates;
    let (kernel, width) = (policy.kernel, critic.trunk_width());
    let memory = memory.float_memory().ok_or(NotFinite)?;
    let entries = front(&mut memory.state, state.len());
    for (entry, value) in entries.iter_mut().zip(normalised(policy, state)) {
        *entry = value;
    }
    let (context, odd) = (front(&mut memory.context, width), front(&mut memory.odd, width));
    affine(kernel, &critic.trunk_state, entries, context);
    kernel.accumulate(critic.trunk_kappa, &[critic.kappa_scale * kappa.to_f32()], context);
    for (out, context) in odd.iter_mut().zip(context) {
        *out = [*context; K];
    }
    kernel.accumulate_columns(critic.trunk_action, actions, odd);
    kernel.mish(odd.as_flattened_mut());
    let trunk = front(&mut memory.even, width);
    affine_columns(kernel, &critic.trunk_2, odd, trunk);
    kernel.mish(trunk.as_flattened_mut());

    let hidden = front(&mut memory.odd, critic.head_width());
    let mut head = |head: &CriticHead<'_>| {
        let mut out = [[0.0; K]];
        affine_columns(kernel, &head.hidden, trunk, hidden);
        kernel.mish(hidden.as_flattened_mut());
        affine_columns(kernel, &head.output, hidden, &mut out);
        let [out] = out;
        out
    };
    let mut twins = |heads: &[CriticHead<'_>; 2]| heads.each_ref().map(&mut head);
    let ([one, two], [first, second]) = (twins(&critic.reward), twins(&critic.cost));
    let mut estimates = [Estimate { reward: 0.0, cost: 0.0 }; K];
    for (estimate, ((one, two), (first, second))) in
        estimates.iter_mut().zip(one.iter().zip(&two).zip(first.iter().zip(&second)))
    {
        // A NaN in either twin passes on.
        estimate.reward = if one <= two || one.is_nan() { *one } else { *two };
        estimate.cost = if first >= second || first.is_nan() { *first } else { *second };
    }
    Ok(estimates)
}

#[cfg(test)]
mod tests;
