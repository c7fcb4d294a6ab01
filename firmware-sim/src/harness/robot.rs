//! The robot around a controller: plant, sensors, actuators and cost monitor.
//!
//! The cost monitor numbers the plant's steps and reports each.

use std::time::Duration;

use armor_core::image::Sections;
use armor_core::noise::below;
use armor_core::units::{Cost, Micros};
use armor_infer::meter::CostReport;
use nalgebra::Vector2;

use super::Setup;
use super::actuators::{Action, Actuators};
use super::record::{Decision, Notice, NoticeSet, Record};
use super::referee::Referee;
use crate::fault::{FaultKind, Injector};
use crate::flight::FlightPlan;
use crate::plant::{Plant, Scene, Thing};

/// Control steps that a late cost report is late by at most.
const LATEST_REPORT: u32 = 5;

/// A robot in an episode.
pub(super) struct Robot<'s> {
    pub(super) injector: Injector,
    pub(super) referee: Referee,
    plant: Box<dyn Plant>,
    action_dim: usize,
    horizon: u32,
    /// Plant steps in a control step.
    hold: u32,
    /// Of a plant step.
    duration: Duration,
    transport: Duration,
    /// Plant steps done.
    steps: u32,
    actuators: Actuators,
    /// Cost reports on their way, with the times when they come.
    reports: Vec<(Duration, CostReport)>,
    record: Record,
    sink: &'s mut dyn FnMut(&Record),
    pub(super) goals: Vec<(Vector2<f64>, f64)>,
    /// Draws that say what of the flash flips before the next reset, and which bit of it.
    pub(super) flash_flips: Vec<[u32; 2]>,
    /// Whether the controller is down.
    is_down: bool,
}

impl<'s> Robot<'s> {
    /// A robot at the start of an episode.
    pub(super) fn new(
        (plan, setup, hold): (&FlightPlan, &Setup, u32),
        plant: Box<dyn Plant>,
        sections: &Sections<'_>,
        injector: Injector,
        sink: &'s mut dyn FnMut(&Record),
    ) -> Self {
        let mut fallback = Action::zeros();
        for (entry, value) in fallback.iter_mut().zip(sections.action_fallback) {
            *entry = *value;
        }
        let referee = Referee::new(plan.limit, action_bounds(sections));
        let record = Record {
            time: Micros(0),
            kappa: None,
            left: plan.limit.cost(),
            reward: 0.0,
            cost: 0.0,
            rung: None,
            fault: None,
            latency: None,
            decision: Decision::Held,
            injected: Default::default(),
            noticed: NoticeSet::default(),
            action: fallback,
            place: plant.scene().robot,
        };
        Self {
            injector,
            referee,
            plant,
            action_dim: plan.task.action,
            horizon: plan.task.horizon as u32,
            hold,
            duration: setup.period(plan) / hold,
            transport: setup.transport,
            steps: 0,
            actuators: Actuators::new(fallback),
            reports: Vec::new(),
            record,
            sink,
            goals: Vec::new(),
            flash_flips: Vec::new(),
            is_down: false,
        }
    }

    /// When the plant's step under way ends.
    pub(super) fn step_end(&self) -> Duration {
        self.duration * (self.steps + 1)
    }

    /// Whether the episode is over.
    pub(super) const fn is_done(&self) -> bool {
        self.steps >= self.horizon
    }

    /// Ends the plant's step under way.
    pub(super) fn advance(&mut self) {
        let end = self.step_end();
        let start = end - self.duration;
        let actuators = &mut self.actuators;
        let late = actuators.since().saturating_sub(start).as_secs_f64() / self.duration.as_secs_f64();
        let goal = goal(&self.plant.scene());
        let [held, action] = actuators.of_step().map(|action| &action.as_slice()[..self.action_dim]);
        let outcome = self.plant.step_late(held, action, late);
        self.steps = if outcome.done { self.horizon } else { self.steps + 1 };
        self.record.reward += outcome.reward;
        self.record.cost += outcome.cost;
        self.referee.incurred(outcome.cost);
        self.report(end, outcome.cost as f32);
        let now_goal = self::goal(&self.plant.scene());
        if now_goal != goal {
            self.goals.extend(now_goal);
        }
        if self.actuators.end_step(end, self.duration * self.hold) {
            self.note(Notice::NoAction);
        }
        if self.steps.is_multiple_of(self.hold) || self.is_done() {
            self.end_record();
        }
    }

    /// Hands the control step over, and begins another.
    fn end_record(&mut self) {
        let record = &mut self.record;
        let decision = self.actuators.take_decision();
        record.decision = if self.is_down { Decision::Down } else { decision };
        record.injected = self.injector.take_struck();
        (record.left, record.action) = (self.referee.left(), self.actuators.action());
        record.place = self.plant.scene().robot;
        (self.sink)(record);
        let next = Micros((self.duration * self.steps).as_micros() as u64);
        *record = Record {
            time: next,
            reward: 0.0,
            cost: 0.0,
            rung: None,
            fault: None,
            latency: None,
            noticed: NoticeSet::default(),
            ..*record
        };
        self.injector.begin(u64::from(self.steps / self.hold));
    }

    /// The monitor reports the cost of the step that has just ended.
    fn report(&mut self, now: Duration, cost: f32) {
        let mut report = CostReport { step: self.steps - 1, cost };
        if self.injector.strikes(FaultKind::CostNegative) {
            report.cost = -1.0 - cost;
        }
        if self.injector.strikes(FaultKind::CostLost) || self.injector.link_is_lost() {
            return;
        }
        let late = match self.injector.strikes(FaultKind::CostLate) {
            true => 1 + below(self.injector.word(FaultKind::CostLate, 1), LATEST_REPORT),
            false => 0,
        };
        let arrival = now + self.transport + self.duration * self.hold * late;
        let copies = if self.injector.strikes(FaultKind::CostDuplicate) { 2 } else { 1 };
        self.reports.extend(std::iter::repeat_n((arrival, report), copies));
    }

    /// The cost reports that have come by now.
    pub(super) fn take_reports(&mut self, now: Duration) -> Vec<CostReport> {
        let come = self.reports.extract_if(.., |(arrival, _)| *arrival <= now);
        come.map(|(_, report)| report).collect()
    }

    /// A sample of the sensors, if it gets through.
    pub(super) fn sense(&mut self, sections: &Sections<'_>) -> Option<Vec<f32>> {
        let mut state = vec![0.0; self.plant.state_dim()];
        self.plant.observe(&mut state);
        self.injector.sense(&mut state, sections.state_factor).map(|()| state)
    }

    /// An action comes to the actuators, unless the link is down.
    pub(super) fn actuate(&mut self, now: Duration, action: &Action, decision: Decision) {
        if self.injector.link_is_lost() {
            return;
        }
        self.referee.action(&action.as_slice()[..self.action_dim]);
        self.actuators.arrive(*action, now, decision);
    }

    /// The controller has a budget; the steps that it was charged for, where it knows.
    pub(super) fn budget(&mut self, kappa: Cost, settled: Option<u32>) {
        self.record.kappa = Some(kappa);
        self.referee.budget(kappa, settled);
    }

    /// The firmware noticed something.
    pub(super) const fn note(&mut self, notice: Notice) {
        self.record.noticed.insert(notice);
    }

    /// The control step under way, for the firmware to fill in.
    pub(super) const fn record(&mut self) -> &mut Record {
        &mut self.record
    }

    /// The controller goes down or comes up.
    pub(super) const fn set_down(&mut self, is_down: bool) {
        self.is_down = is_down;
    }

    /// What the robot looks like now.
    pub(super) fn scene(&self) -> Scene {
        self.plant.scene()
    }
}

/// The bounds of each action entry.
fn action_bounds(sections: &Sections<'_>) -> Vec<(f32, f32)> {
    sections.action_low.iter().copied().zip(sections.action_high.iter().copied()).collect()
}

/// The goal of a scene and its radius.
fn goal(scene: &Scene) -> Option<(Vector2<f64>, f64)> {
    scene.things.iter().find_map(|thing| match *thing {
        Thing::Goal(place, radius) => Some((place, radius)),
        _ => None,
    })
}
