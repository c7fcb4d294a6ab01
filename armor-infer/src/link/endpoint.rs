//! The controller's side of the link: a request in, an answer out.
//!
//! A request may be lost, and then the plant asks again; so it may come twice.
//! A doubled request is answered as before and changes nothing: a budget is
//! charged once and refilled once, whatever the line does. A late one is not
//! answered at all.

use core::mem::MaybeUninit;

use armor_core::image::PolicyImage;
use armor_core::units::{Cost, CostLimit};
use heapless::Vec;

use super::frame::{FrameError, decode};
use super::message::{Answer, Identity, Refusal, Request, VERSION};
use crate::controller::{Controller, Step};
use crate::golden::{self, GoldenError};
use crate::policy::{LoadError, Policy};

/// A controller behind a link.
pub struct Endpoint<'a, const STATE: usize, const ACTION: usize, const HIDDEN: usize> {
    task: &'a str,
    policy: Policy<'a>,
    controller: Controller<'a, STATE, ACTION, HIDDEN>,
    max_steps: usize,
    greeted: bool,
    /// Number of the last episode; 0 before the first.
    episode: u32,
    /// Control steps of the episode so far.
    ticks: u64,
    /// The last of them.
    last: Option<Step<ACTION>>,
}

impl<'a, const STATE: usize, const ACTION: usize, const HIDDEN: usize> Endpoint<'a, STATE, ACTION, HIDDEN> {
    /// The controller of an image, before its first episode. Each action flies
    /// the longest chain of at most `max_steps` calls of the denoiser.
    ///
    /// # Errors
    /// [`LoadError`] if the policy does not fit the capacities.
    pub fn new(image: &PolicyImage<'a>, max_steps: usize) -> Result<Self, LoadError> {
        let policy = Policy::load(image)?;
        Ok(Self::around(image, policy, max_steps, Controller::new(policy, CostLimit::ZERO, 0)?))
    }

    /// As [`Endpoint::new`], in place: on a stack that is too small for a controller.
    ///
    /// # Errors
    /// [`LoadError`], as there; nothing was written then.
    pub fn new_in<'p>(
        place: &'p mut MaybeUninit<Self>,
        image: &PolicyImage<'a>,
        max_steps: usize,
    ) -> Result<&'p mut Self, LoadError> {
        let policy = Policy::load(image)?;
        policy.check_capacities(STATE, ACTION, HIDDEN)?;
        let endpoint = place.write(Self::around(image, policy, max_steps, Controller::idle(policy)));
        endpoint.controller.start(CostLimit::ZERO, 0);
        Ok(endpoint)
    }

    /// As of [`Controller::idle`].
    #[inline(always)]
    const fn around(
        image: &PolicyImage<'a>,
        policy: Policy<'a>,
        max_steps: usize,
        controller: Controller<'a, STATE, ACTION, HIDDEN>,
    ) -> Self {
        let task = image.manifest().task;
        Self { task, policy, controller, max_steps, greeted: false, episode: 0, ticks: 0, last: None }
    }

    /// Replays the golden trace on the endpoint's own controller, before the
    /// first episode; returns the number of rows.
    ///
    /// # Errors
    /// [`GoldenError`]; the image must not fly on this machine then.
    pub fn replay_golden(&mut self, image: &PolicyImage<'_>) -> Result<usize, GoldenError> {
        let rows = golden::replay_on(&mut self.controller, &image.sections().golden)?;
        // Nothing flies before a reset names its limit.
        self.controller.new_episode(CostLimit::ZERO, 0)?;
        (self.episode, self.ticks, self.last) = (0, 0, None);
        Ok(rows)
    }

    /// The answer to a received frame, which is overwritten; none where there
    /// is nothing to say, because the frame was damaged or late.
    pub fn receive(&mut self, frame: &mut [u8]) -> Option<Answer<'a, ACTION>> {
        // By reference: a request that is moved is on the stack twice.
        match &decode(frame) {
            Ok(request) => self.answer(request),
            Err(FrameError::Malformed) => Some(Answer::Refused(Refusal::Malformed)),
            Err(FrameError::Damaged | FrameError::Full) => None,
        }
    }

    /// The answer to a request; none to a late one.
    pub fn answer(&mut self, request: &Request<STATE>) -> Option<Answer<'a, ACTION>> {
        match request {
            Request::Hello { version } => Some(self.hello(*version)),
            _ if !self.greeted => Some(Answer::Refused(Refusal::NoHello)),
            Request::Reset { episode, limit, seed } => self.reset(*episode, *limit, *seed),
            Request::Observe { episode, tick, incurred, state } => self.observe(*episode, *tick, *incurred, state),
        }
    }

    fn hello(&mut self, version: u8) -> Answer<'a, ACTION> {
        if version != VERSION {
            return Answer::Refused(Refusal::Version { supported: VERSION });
        }
        self.greeted = true;
        let shape = self.policy.shape();
        Answer::Hello(Identity {
            version: VERSION,
            task: self.task,
            state: shape.state,
            action: shape.action,
            rungs: self.policy.rungs().map(|steps| steps as u16).collect(),
            trained_max: self.policy.trained_max(),
            episode: self.episode,
        })
    }

    fn reset(&mut self, episode: u32, limit: Cost, seed: u64) -> Option<Answer<'a, ACTION>> {
        let next = self.next_episode();
        if episode < self.episode {
            return None;
        }
        if episode > next || episode == 0 {
            return Some(Answer::Refused(Refusal::Episode { next }));
        }
        if episode > self.episode {
            if self.controller.new_episode(CostLimit::from_cost(limit), seed).is_err() {
                return Some(Answer::Refused(Refusal::Limit { trained_max: self.policy.trained_max() }));
            }
            self.episode = episode;
            self.ticks = 0;
            self.last = None;
        }
        Some(Answer::Ready { episode, kappa: self.controller.kappa() })
    }

    fn observe(&mut self, episode: u32, tick: u32, incurred: f32, state: &[f32]) -> Option<Answer<'a, ACTION>> {
        if episode < self.episode {
            return None;
        }
        if episode > self.episode || episode == 0 {
            return Some(Answer::Refused(Refusal::Episode { next: self.next_episode() }));
        }
        match (u64::from(tick) + 1).checked_sub(self.ticks) {
            // Late: a newer one was answered.
            None => return None,
            // Doubled: charged and answered before.
            Some(0) => {}
            Some(1) => {
                self.last = Some(self.controller.step_within(state, incurred, self.max_steps));
                self.ticks += 1;
            }
            // As a later tick was asked for, this one is within its range.
            Some(_) => return Some(Answer::Refused(Refusal::Tick { next: self.ticks as u32 })),
        }
        self.last.map(|step| self.act(tick, &step))
    }

    fn act(&self, tick: u32, step: &Step<ACTION>) -> Answer<'a, ACTION> {
        Answer::Act {
            episode: self.episode,
            tick,
            kappa: step.kappa,
            rung: step.rung.map(|rung| rung as u8),
            fault: step.fault,
            action: step.action.iter().take(self.policy.shape().action.into()).copied().collect::<Vec<_, ACTION>>(),
        }
    }

    const fn next_episode(&self) -> u32 {
        self.episode.saturating_add(1)
    }
}
