//! What a flight is besides its task: board, faults, and the times that follow from them.

use std::time::Duration;

use armor_core::image::PolicyImage;
use armor_core::units::Cost;
use armor_infer::Policy;
use armor_infer::journal::Reserve;

use super::deadline::Deadline;
use super::firmware::POWER_OFF;
use crate::board::Board;
use crate::fault::Injection;
use crate::flight::FlightPlan;

/// Share of a period that is left for the rest of a firmware: link, journal, scrub.
const MARGIN: f64 = 0.1;
/// The largest cost of a plant step, in every native task.
const WORST_COST: f32 = 1.0;
/// What a microcontroller takes to come up, besides the check of its image.
const START_UP: Duration = Duration::from_millis(20);
/// Cycles to take the checksum of a byte, by a table of bytes.
const CHECKSUM_CYCLES: f64 = 8.0;

/// Everything of a flight that is not its task.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// The board that computes the actions; none for this host, which answers at once.
    pub board: Option<&'static Board>,
    /// Faults that are injected.
    pub faults: Vec<Injection>,
    /// Time that a sample travels to the controller, and an action to the actuators.
    pub transport: Duration,
    /// Time without an answer after which the watchdog resets the controller.
    pub watchdog: Duration,
    /// How far below kappa the journal's floor lies.
    pub reserve: Reserve,
    /// Candidates for each action ([`crate::host::CANDIDATES`]).
    pub candidates: u8,
    /// Time from a reset to the first sample.
    pub(super) boot: Duration,
}

impl Setup {
    /// A setup for a plan and an image: the watchdog waits for three periods,
    /// and the journal's reserve covers a reset.
    pub fn new(
        plan: &FlightPlan,
        image: &PolicyImage<'_>,
        board: Option<&'static Board>,
        faults: Vec<Injection>,
    ) -> Self {
        let period = Duration::from_micros(plan.period().0);
        let checksum = CHECKSUM_CYCLES * image.bytes().len() as f64;
        let boot = START_UP
            + board.map_or(Duration::ZERO, |board| Duration::from_secs_f64(checksum / f64::from(board.clock_hz)));
        let mut setup = Self {
            board,
            faults,
            transport: Duration::ZERO,
            watchdog: 3 * period,
            reserve: Reserve { step: Cost::ZERO, ahead: worst_cost() },
            candidates: 1,
            boot,
        };
        setup.reserve.step = worst_cost().saturating_mul(setup.blind_steps(plan));
        setup
    }

    /// The same with samples and actions that travel for `transport`.
    #[must_use]
    pub fn with_transport(mut self, plan: &FlightPlan, transport: Duration) -> Self {
        self.transport = transport;
        self.reserve.step = worst_cost().saturating_mul(self.blind_steps(plan));
        self
    }

    /// Steps of the longest chain that ends in time; 0 if there is none.
    pub fn steps_in_time(&self, plan: &FlightPlan, image: &PolicyImage<'_>) -> usize {
        Deadline::new(rung_times(image, self, plan.max_steps), self.answer_time(plan)).steps()
    }

    /// The same with the best of so many candidates for each action.
    #[must_use]
    pub const fn with_candidates(mut self, candidates: u8) -> Self {
        self.candidates = candidates;
        self
    }

    /// Time between samples.
    pub(super) fn period(&self, plan: &FlightPlan) -> Duration {
        Duration::from_micros(plan.period().0)
    }

    /// What an answer may take.
    pub(super) fn answer_time(&self, plan: &FlightPlan) -> Duration {
        self.period(plan).mul_f64(1.0 - MARGIN).saturating_sub(2 * self.transport)
    }

    /// Plant steps whose costs the controller may never hear of around a reset:
    /// those of an answer that just satisfies the watchdog, until it strikes
    /// then, without power, and while it boots; a control step on either side,
    /// and two that a slow clock may be behind.
    fn blind_steps(&self, plan: &FlightPlan) -> u32 {
        let period = self.period(plan);
        let hold = plan.task.rate_hz / plan.rate_hz;
        let blind = 2 * self.watchdog + POWER_OFF + self.boot + 2 * self.transport;
        (blind.as_secs_f64() / period.as_secs_f64()).ceil() as u32 * hold + 4 * hold
    }
}

/// Steps of each rung that a plan allows and the longest that it takes, longest chain first.
pub(super) fn rung_times(image: &PolicyImage<'_>, setup: &Setup, max_steps: usize) -> Vec<(usize, Duration)> {
    let Ok(policy) = Policy::load(image) else { return Vec::new() };
    let worst = |rung| setup.board.and_then(|board| board.action(image, rung)).map_or(Duration::ZERO, |a| a.worst);
    let rungs = policy.rungs().enumerate().map(|(rung, steps)| (steps, worst(rung)));
    rungs.filter(|(steps, _)| *steps <= max_steps).collect()
}

/// The largest cost of a plant step.
pub(super) fn worst_cost() -> Cost {
    Cost::from_incurred(WORST_COST).unwrap_or(Cost::MAX)
}
