//! From a sample to an action: settle the costs, write the charge to the
//! journal, let a chain answer, decide, send.

use std::time::{Duration, Instant};

use armor_core::image::Sections;
use armor_core::noise::{below, uniform};
use armor_infer::journal::Journal;
use armor_infer::meter::Settled;
use armor_infer::{Fault, Step};

use super::super::actuators::Action;
use super::super::clock::Agenda;
use super::super::record::{Decision, Notice};
use super::super::robot::Robot;
use super::super::setup::Setup;
use super::{End, Event, Firmware, POWER_OFF, Weights};
use crate::fault::FaultKind;
use crate::flash::NorModel;
use crate::host::{ACTION, Pilot};

/// Answers without a chain in which the last action is held.
const HOLDS: u32 = 3;
/// Answers after which the weights in RAM are checked.
const SCRUB: u64 = 50;
/// Samples without a cost report after which a control step is charged for
/// two, for the clock that counts them may be slow.
const SILENCE: u32 = 4;

impl Firmware<'_> {
    /// Sample and reports are there: the journal covers what they charge, and the controller steps.
    pub(super) fn receive(
        &mut self,
        controller: &mut dyn Pilot,
        (robot, agenda): (&mut Robot<'_>, &mut Agenda<Event>),
        journal: &mut Option<Journal<NorModel>>,
    ) -> Option<End> {
        let now = agenda.now();
        let (sampled, state, due) = self.sample.take()?;
        let settled = self.settle(robot, now, due);
        let loses_power = robot.injector.strikes(FaultKind::BrownOut);
        if loses_power {
            let draw = robot.injector.word(FaultKind::BrownOut, 1);
            *journal = journal.take().and_then(|journal| cut_soon(journal, self.setup, draw));
        }
        // Before anyone acts on the charge: a reset from here on must not forget it.
        self.is_covered = journal.as_mut().is_some_and(|journal| journal.charge(self.kappa, settled.incurred).is_ok());
        if !self.is_covered {
            robot.note(Notice::Journal);
        }
        if loses_power {
            return Some(End::Reset(POWER_OFF));
        }

        let steps = self.deadline.steps();
        let step = self.step(controller, (state, settled.incurred), steps);
        self.kappa = step.kappa;
        robot.budget(step.kappa, self.meter.next());
        if let Some(fault) = step.fault {
            robot.note(Notice::of(fault));
        }
        if robot.injector.strikes(FaultKind::WatchdogReset) {
            self.is_hung = true;
            return None;
        }
        let latency = self.latency(&step).mul_f64(robot.injector.stretch());
        let record = robot.record();
        (record.rung, record.fault, record.latency) = (step.rung, step.fault, step.rung.map(|_| latency));
        let (action, decision) = self.decide(&step);
        self.answer = Some((sampled, steps, action, decision));
        agenda.at(now + latency, Event::Answer);
        None
    }

    /// What the cost reports that have come by now charge.
    fn settle(&mut self, robot: &mut Robot<'_>, now: Duration, due: u32) -> Settled {
        let reports = robot.take_reports(now);
        self.silent = if reports.is_empty() { self.silent + 1 } else { 0 };
        let settled = self.meter.settle(&reports, due);
        if let Some(next) = self.meter.next() {
            // The monitor knows the time: a clock that is slow must not forget what it says.
            self.due = self.due.max(next + self.hold);
        }
        if self.silent > SILENCE {
            self.due += self.hold;
        }
        if settled.missing > 0 {
            robot.note(Notice::MissingCost);
        }
        if settled.stale > 0 {
            robot.note(Notice::StaleCost);
        }
        settled
    }

    /// The controller's step, from the weights that RAM holds.
    fn step(
        &mut self,
        controller: &mut dyn Pilot,
        (state, incurred): (Option<Vec<f32>>, f32),
        steps: usize,
    ) -> Step<ACTION> {
        let is_broken = self.weights == Weights::Broken;
        let mut state = state.unwrap_or_default();
        if is_broken {
            state.fill(f32::NAN);
        }
        let started = Instant::now();
        let mut step = controller.step_within(&state, incurred, steps);
        self.host_times.push(started.elapsed());
        if is_broken && step.fault == Some(Fault::StateNotFinite) {
            step.fault = Some(Fault::ActionNotFinite);
        }
        step
    }

    /// What to do with a step: its action, or the last one for a while, or the fallback.
    fn decide(&mut self, step: &Step<ACTION>) -> (Action, Decision) {
        if step.rung.is_some() {
            self.holds = 0;
            self.last = Some(step.action);
            return (step.action, Decision::Policy);
        }
        self.holds += 1;
        match self.last.filter(|_| self.holds <= HOLDS) {
            Some(last) => (last, Decision::Held),
            None => (step.action, Decision::Fallback),
        }
    }

    /// How long a step takes on the board, with the jitter of this answer; no time on the host.
    fn latency(&mut self, step: &Step<ACTION>) -> Duration {
        self.answers += 1;
        let modelled = step.rung.and_then(|rung| self.actions.get(rung).copied().flatten());
        let share = f64::from(uniform(self.jitter.words(0, self.answers, 0)[0]));
        modelled.map_or(Duration::ZERO, |action| action.time + (action.worst - action.time).mul_f64(share))
    }

    /// The answer is there, and goes out, unless it is late; where the journal
    /// does not cover it, the fallback does.
    pub(super) fn release(
        &mut self,
        sections: &Sections<'_>,
        robot: &mut Robot<'_>,
        agenda: &mut Agenda<Event>,
    ) -> Option<End> {
        let now = agenda.now();
        let (sampled, steps, mut action, mut decision) = self.answer.take()?;
        self.last_kick = now;
        let arrival = now + self.setup.transport;
        let is_late = arrival > sampled + self.period;
        self.deadline.answered(steps, is_late);
        if is_late {
            robot.note(Notice::Late);
            return None;
        }
        if !self.is_covered {
            decision = Decision::Fallback;
            for (entry, fallback) in action.iter_mut().zip(sections.action_fallback) {
                *entry = *fallback;
            }
        }
        if self.answers.is_multiple_of(SCRUB) && self.weights != Weights::Whole {
            robot.note(Notice::Weights);
            return Some(End::Reset(Duration::ZERO));
        }
        self.sent = Some((action, decision));
        agenda.at(arrival, Event::Actuate);
        None
    }
}

/// The journal, on a flash whose power fails within its next nine operations:
/// a floor is written in eight.
fn cut_soon(journal: Journal<NorModel>, setup: &Setup, draw: u32) -> Option<Journal<NorModel>> {
    let mut flash = journal.into_flash();
    flash.cut_power_after(below(draw, 9).into(), draw.into());
    Journal::open(flash, crate::chip::JOURNAL, setup.reserve).ok()
}
