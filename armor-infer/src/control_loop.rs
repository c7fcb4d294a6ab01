//! The loop of [`crate::controller`], for one or several candidate actions a step.

use armor_core::budget::Budget;
use armor_core::noise::Noise;
use armor_core::units::{Cost, CostLimit};
use nalgebra::SVector;

use crate::controller::{Fault, Step};
use crate::denoiser::{Denoiser, NotFinite, front};
use crate::policy::{LoadError, Policy};
use crate::sampler::Sampler;

/// A policy in flight that draws `K` candidates for every action.
pub(crate) struct ControlLoop<'a, const STATE: usize, const ACTION: usize, const HIDDEN: usize, const K: usize> {
    policy: Policy<'a>,
    budget: Budget,
    noise: Noise,
    tick: u64,
    denoiser: Denoiser<STATE, HIDDEN, K>,
    sampler: Sampler<ACTION, K>,
}

/// What a choice is taken from: `K` candidates for the action from a state.
pub(crate) struct Candidates<'c, 'a, const STATE: usize, const HIDDEN: usize, const K: usize> {
    pub(crate) policy: &'c Policy<'a>,
    pub(crate) state: &'c [f32],
    pub(crate) kappa: Cost,
    /// Entry by entry, `[A]` of `K`.
    pub(crate) actions: &'c [[f32; K]],
    /// The denoiser's memory, which the choice may use.
    pub(crate) memory: &'c mut Denoiser<STATE, HIDDEN, K>,
}

impl<'a, const STATE: usize, const ACTION: usize, const HIDDEN: usize, const K: usize>
    ControlLoop<'a, STATE, ACTION, HIDDEN, K>
{
    pub(crate) fn new(policy: Policy<'a>, limit: CostLimit, seed: u64) -> Result<Self, LoadError> {
        Self::admit(&policy, limit)?;
        let mut flight = Self::idle(policy);
        flight.start(limit, seed);
        Ok(flight)
    }

    /// Whether a policy and its first limit may fly here.
    pub(crate) fn admit(policy: &Policy<'_>, limit: CostLimit) -> Result<(), LoadError> {
        policy.check_capacities(STATE, ACTION, HIDDEN)?;
        policy.check_limit(limit)
    }

    /// A loop whose memory does not suit its policy yet. All that varies in it
    /// is small, so that the compiler makes it where it is to lie.
    #[inline(always)]
    pub(crate) const fn idle(policy: Policy<'a>) -> Self {
        let (budget, noise) = (Budget::new(CostLimit::ZERO), Noise::new(0));
        Self { policy, budget, noise, tick: 0, denoiser: Denoiser::idle(), sampler: Sampler::new() }
    }

    /// The start of the first episode.
    pub(crate) fn start(&mut self, limit: CostLimit, seed: u64) {
        self.denoiser.suit(&self.policy);
        (self.budget, self.noise, self.tick) = (Budget::new(limit), Noise::new(seed), 0);
    }

    pub(crate) fn new_episode(&mut self, limit: CostLimit, seed: u64) -> Result<(), LoadError> {
        self.policy.check_limit(limit)?;
        (self.budget, self.noise, self.tick) = (Budget::new(limit), Noise::new(seed), 0);
        Ok(())
    }

    /// One control step; `choose` says which of the candidates to take.
    pub(crate) fn step(
        &mut self,
        state: &[f32],
        incurred: f32,
        steps: usize,
        choose: impl FnOnce(Candidates<'_, 'a, STATE, HIDDEN, K>) -> Result<usize, NotFinite>,
    ) -> Step<ACTION> {
        let charged = self.budget.charge(incurred);

        let mut action = SVector::<f32, ACTION>::zeros();
        let entries = action.as_mut_slice().get_mut(..usize::from(self.policy.shape.action)).unwrap_or_default();
        let acted = self.act(state, steps, choose, entries);
        if acted.is_err() {
            for (entry, fallback) in entries.iter_mut().zip(self.policy.sections.action_fallback) {
                *entry = *fallback;
            }
        }
        self.tick = self.tick.wrapping_add(1);

        let fault = acted.err().or(charged.err().map(|_| Fault::InvalidCost));
        Step { action, kappa: self.kappa(), rung: acted.ok(), fault }
    }

    pub(crate) const fn kappa(&self) -> Cost {
        self.budget.remaining()
    }

    /// Computes the policy's action at this tick and budget, into `action`
    /// `[A]`; returns the rung that flew.
    fn act(
        &mut self,
        state: &[f32],
        steps: usize,
        choose: impl FnOnce(Candidates<'_, 'a, STATE, HIDDEN, K>) -> Result<usize, NotFinite>,
        action: &mut [f32],
    ) -> Result<usize, Fault> {
        if state.len() != usize::from(self.policy.shape.state) {
            return Err(Fault::StateLength);
        }
        if state.iter().any(|value| !value.is_finite()) {
            return Err(Fault::StateNotFinite);
        }
        let rung = self.policy.rung_within(steps).ok_or(Fault::NoRung)?;
        let kappa = self.budget.remaining();
        self.denoiser.prepare(&self.policy, state, kappa)?;
        let mut candidates = [[0.0; K]; ACTION];
        let actions = front(&mut candidates, action.len());
        self.sampler.run((&self.policy, rung), &mut self.denoiser, (&self.noise, self.tick), actions)?;

        let (policy, memory) = (&self.policy, &mut self.denoiser);
        let chosen = choose(Candidates { policy, state, kappa, actions, memory })?;
        for (entry, candidates) in action.iter_mut().zip(&*actions) {
            *entry = *candidates.get(chosen).ok_or(Fault::ActionNotFinite)?;
        }
        Ok(rung)
    }
}
