//! What the microcontroller does between a boot and a reset: the loop that a
//! firmware around `armor-infer` is made of.
//!
//! A sample and the cost reports come; the reports are settled; the journal
//! covers what they charge; the longest rung that ends in time answers; the
//! action goes out. Where no chain answers, the last action is held for a few control
//! steps, and then the fallback is taken. Now and then the checksum of the
//! weights in RAM is taken again; where it is wrong, the firmware resets itself.

mod answer;

use std::time::Duration;

use armor_core::image::{PolicyImage, Sections};
use armor_core::noise::Noise;
use armor_core::units::{Cost, CostLimit};
use armor_infer::journal::Journal;
use armor_infer::meter::CostMeter;

use super::actuators::Action;
use super::clock::Agenda;
use super::deadline::Deadline;
use super::record::{Decision, Notice};
use super::robot::Robot;
use super::setup::{Setup, rung_times};
use crate::board::model::Modelled;
use crate::fault::FaultKind;
use crate::flash::NorModel;
use crate::flight::{FlightError, FlightPlan};
use crate::host;

/// Time without power after a brown-out.
pub(super) const POWER_OFF: Duration = Duration::from_millis(20);

/// What happens. Of events at one time the first here comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Event {
    /// The plant's step ends.
    Step,
    /// The controller's timer says that a sample is due.
    Sample,
    /// The sample comes to the controller, and the cost reports.
    Receive,
    /// The answer is computed.
    Answer,
    /// It comes to the actuators.
    Actuate,
    /// The watchdog looks.
    Watchdog,
    /// The controller is up again.
    Booted,
}

/// Why a firmware's loop ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// The episode is over.
    Over,
    /// The controller is reset; without power for a time first.
    Reset(Duration),
    /// A bit of the weights in RAM flips: the draw that says which.
    RamFlip(u32),
}

/// What the loop keeps in RAM beside the controller.
pub(super) struct Firmware<'s> {
    setup: &'s Setup,
    period: Duration,
    hold: u32,
    /// The budget, from which the controller starts.
    kappa: Cost,
    meter: CostMeter,
    /// Plant steps that should have ended by the controller's own clock.
    due: u32,
    /// Samples since the last cost report.
    silent: u32,
    deadline: Deadline,
    /// What an action of each rung takes; nothing on this host.
    actions: Vec<Option<Modelled>>,
    /// When the sample was taken, what it says, and how many steps were due.
    sample: Option<(Duration, Option<Vec<f32>>, u32)>,
    /// What is being computed: when it was sampled, its steps, the action and why.
    answer: Option<(Duration, usize, Action, Decision)>,
    /// What is on its way to the actuators.
    sent: Option<(Action, Decision)>,
    /// Whether the journal covers the step that is being computed.
    is_covered: bool,
    last: Option<Action>,
    holds: u32,
    is_hung: bool,
    last_kick: Duration,
    answers: u64,
    /// Whether the weights in RAM have changed, and whether they are still numbers.
    weights: Weights,
    flipped_at: Option<Duration>,
    jitter: Noise,
    /// Host time of the controller's steps.
    pub(super) host_times: Vec<Duration>,
}

/// What has become of the weights in RAM.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Weights {
    /// Nothing.
    Whole,
    /// They have changed, and the image still checks but for its checksum.
    Changed,
    /// They hold what no image may: the network's answer is taken for not finite.
    Broken,
}

impl<'s> Firmware<'s> {
    /// The firmware after a boot.
    pub(super) fn booted(
        (plan, setup, hold): (&FlightPlan, &'s Setup, u32),
        image: &PolicyImage<'_>,
        (kappa, meter): (Cost, CostMeter),
        (now, seed): (Duration, u64),
    ) -> Self {
        let period = setup.period(plan);
        let rungs = rung_times(image, setup, plan.max_steps);
        Self {
            setup,
            period,
            hold,
            kappa,
            meter,
            due: 0,
            silent: 0,
            actions: (0..image.manifest().rungs.len()).map(|rung| setup.board?.action(image, rung)).collect(),
            deadline: Deadline::new(rungs, setup.answer_time(plan)),
            sample: None,
            answer: None,
            sent: None,
            is_covered: false,
            last: None,
            holds: 0,
            is_hung: false,
            last_kick: now,
            answers: 0,
            weights: Weights::Whole,
            flipped_at: None,
            jitter: Noise::new(seed),
            host_times: Vec::new(),
        }
    }

    /// The weights in RAM have changed.
    pub(super) const fn set_weights(&mut self, weights: Weights) {
        self.weights = weights;
    }

    /// Flies until the episode is over, the controller is reset, or a bit of `image` flips.
    pub(super) fn fly(
        &mut self,
        image: &PolicyImage<'_>,
        seed: u64,
        (robot, agenda): (&mut Robot<'_>, &mut Agenda<Event>),
        journal: &mut Option<Journal<NorModel>>,
    ) -> Result<End, FlightError> {
        let limit = CostLimit::from_cost(self.kappa);
        let mut controller = host::pilot(image, limit, seed, self.setup.candidates).map_err(FlightError::Load)?;
        while let Some(event) = agenda.next() {
            let now = agenda.now();
            match event {
                Event::Step => {
                    robot.advance();
                    if robot.is_done() {
                        return Ok(End::Over);
                    }
                    agenda.at(robot.step_end(), Event::Step);
                }
                Event::Watchdog if now - self.last_kick >= self.setup.watchdog => {
                    return Ok(End::Reset(Duration::ZERO));
                }
                Event::Watchdog => agenda.at(self.last_kick + self.setup.watchdog, Event::Watchdog),
                _ if self.is_hung => {}
                Event::Sample => {
                    if self.flipped_at != Some(now) && robot.injector.strikes(FaultKind::RamFlip) {
                        self.flipped_at = Some(now);
                        agenda.at(now, Event::Sample);
                        return Ok(End::RamFlip(robot.injector.word(FaultKind::RamFlip, 1)));
                    }
                    self.sample(image.sections(), robot, agenda);
                }
                Event::Receive => {
                    if let Some(end) = self.receive(controller.as_mut(), (robot, agenda), journal) {
                        return Ok(end);
                    }
                }
                Event::Answer => {
                    if let Some(end) = self.release(image.sections(), robot, agenda) {
                        return Ok(end);
                    }
                }
                Event::Actuate => {
                    if let Some((action, decision)) = self.sent.take() {
                        robot.actuate(now, &action, decision);
                    }
                }
                Event::Booted => {}
            }
        }
        Ok(End::Over)
    }

    /// The timer says that a sample is due; it also sets the next.
    fn sample(&mut self, sections: &Sections<'_>, robot: &mut Robot<'_>, agenda: &mut Agenda<Event>) {
        let now = agenda.now();
        let due = self.due;
        self.due += self.hold;
        let mut next = self.period.mul_f64(1.0 + robot.injector.slowness());
        match robot.injector.clock_jump() {
            steps @ 0.. => self.due += steps.unsigned_abs() * self.hold,
            steps => next += self.period * steps.unsigned_abs(),
        }
        agenda.at(now + next, Event::Sample);
        if robot.injector.strikes(FaultKind::FlashFlip) {
            robot.flash_flips.push([1, 2].map(|draw| robot.injector.word(FaultKind::FlashFlip, draw)));
        }
        if self.sample.is_some() || self.answer.is_some() {
            robot.note(Notice::Skipped);
            return;
        }
        self.sample = Some((now, robot.sense(sections), due));
        agenda.at(now + self.setup.transport, Event::Receive);
    }
}
