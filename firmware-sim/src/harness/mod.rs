//! A robot's day: a policy in flash flies a plant on a virtual clock, where
//! samples travel, actions take time, and everything breaks that breaks in the
//! field.
//!
//! ```text
//! sample --transport--> settle costs, step --latency--> journal --transport--> actuators
//!    every control step      a rung that ends in time      |         hold until the next
//!                            watchdog <--------------------+
//! ```
//!
//! The clock is virtual and every draw is seeded: a flight repeats itself bit
//! for bit. A latency is that of a board's model ([`crate::board`]), or none
//! where the host flies. The plant goes on while the controller computes; an
//! action takes effect at the next sub-step of the plant.
//!
//! Whatever the faults, two things must hold, and a referee who knows the
//! truth counts where they do not: no action out of range ever comes to the
//! actuators, and the controller never has more budget than the limit less
//! what was truly incurred by the steps that it was charged for.
//!
//! One simplification: weights that a flipped bit turns into what no image may
//! hold are taken for a network that answers no number, at once.
//!
//! Words: a *period* is the time from one sample to the next, a control step;
//! *transport* is the time that a sample or an action travels; *late* is an
//! answer that comes to the actuators after its period; a *scrub* is a check of
//! the weights in RAM.

mod clock;
mod deadline;
mod firmware;
mod flown;
mod record;
mod referee;
mod robot;
pub mod soak;
pub mod sweep;
mod tally;

use std::time::Duration;

use armor_core::image::{HEADER_BYTES, PolicyImage, SectionKind, Sections};
use armor_core::noise::below;
use armor_core::units::Cost;
use armor_infer::Policy;
use armor_infer::journal::{Journal, Reserve};
use armor_infer::meter::CostMeter;
use crc::{CRC_32_ISO_HDLC, Crc};
use thiserror::Error;

use crate::board::Board;
use crate::chip::{Boot, BootError, Chip, FlashError, JOURNAL, Slot};
use crate::fault::{Injection, Injector};
use crate::flash::FlashFault;
use crate::flight::{FlightError, FlightPlan, Use, check, episode_seed};
use crate::memory::AlignedBytes;
use clock::Agenda;
use deadline::Deadline;
use firmware::{End, Event, Firmware, Weights};
use robot::Robot;

pub use flown::{RobotFlight, fly_all};
pub use record::{Decision, Notice, NoticeSet, Record, RobotEpisode};
pub use tally::Tally;

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
    boot: Duration,
}

/// A robot's controller, which goes on from episode to episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Device {
    chip: Chip,
    memory: AlignedBytes,
}

/// Why a new chip does not fly an image.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum NotFlashed {
    /// The image was refused.
    #[error(transparent)]
    Refused(#[from] FlashError),
    /// The chip does not boot.
    #[error(transparent)]
    Boot(#[from] BootError),
    /// The flash failed.
    #[error("the flash failed: {0}")]
    Flash(#[from] FlashFault),
}

/// Where an episode ends.
#[derive(Clone, Debug, PartialEq)]
pub struct Ended {
    /// What was seen from outside, without the records.
    pub episode: RobotEpisode,
    /// What was counted.
    pub tally: Tally,
    /// Host time of each of the controller's steps.
    pub host_times: Vec<Duration>,
    /// Whether the chip still boots.
    pub is_alive: bool,
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
    fn period(&self, plan: &FlightPlan) -> Duration {
        Duration::from_micros(plan.period().0)
    }

    /// What an answer may take.
    fn answer_time(&self, plan: &FlightPlan) -> Duration {
        self.period(plan).mul_f64(1.0 - MARGIN).saturating_sub(2 * self.transport)
    }

    /// Plant steps whose costs the controller may never hear of around a reset:
    /// those of an answer that just satisfies the watchdog, until it strikes
    /// then, without power, and while it boots; a control step on either side,
    /// and two that a slow clock may be behind.
    fn blind_steps(&self, plan: &FlightPlan) -> u32 {
        let period = self.period(plan);
        let hold = plan.task.rate_hz / plan.rate_hz;
        let blind = 2 * self.watchdog + firmware::POWER_OFF + self.boot + 2 * self.transport;
        (blind.as_secs_f64() / period.as_secs_f64()).ceil() as u32 * hold + 4 * hold
    }
}

impl Device {
    /// The controller of a chip that has booted.
    pub fn new(chip: Chip, boot: &Boot) -> Self {
        Self { chip, memory: boot.image.clone() }
    }

    /// A new chip with an image in both slots, booted and confirmed.
    ///
    /// # Errors
    /// [`NotFlashed`]
    pub fn flashed(image: &[u8]) -> Result<Self, NotFlashed> {
        let mut chip = Chip::blank();
        for _ in [Slot::A, Slot::B] {
            chip.flash(image, None)?;
            chip.boot()?;
            chip.confirm()?;
        }
        let boot = chip.boot()?;
        Ok(Self::new(chip, &boot))
    }

    /// Switches the controller off and on; whether a slot was passed over.
    ///
    /// # Errors
    /// [`BootError`]; it does not fly any more then.
    pub fn reboot(&mut self) -> Result<bool, BootError> {
        let boot = self.chip.boot()?;
        self.memory = boot.image;
        Ok(boot.passed_over.is_some())
    }

    /// The chip, as flights left it.
    pub fn into_chip(self) -> Chip {
        self.chip
    }

    /// The chip, as flights left it.
    pub const fn chip(&self) -> &Chip {
        &self.chip
    }

    /// The image that flies.
    pub fn image(&self) -> &[u8] {
        self.memory.as_slice()
    }
}

/// Flies episode number `index` of a plan; each control step goes to `sink`.
///
/// # Errors
/// [`FlightError`]
pub fn fly(
    device: &mut Device,
    plan: &FlightPlan,
    setup: &Setup,
    index: u32,
    sink: &mut dyn FnMut(&Record),
) -> Result<Ended, FlightError> {
    let start = PolicyImage::new_checked(device.memory.as_slice()).map_err(|_| FlightError::Image)?;
    let hold = check(&start, plan)? as u32;
    if 2 * setup.transport >= setup.period(plan) {
        let [transport_us, period_us] = [setup.transport, setup.period(plan)].map(|time| time.as_micros() as u64);
        return Err(FlightError::Transport { transport_us, period_us });
    }
    let mut plant = plan.task.plant()?;
    plant.reset(episode_seed(plan.seed, Use::Plant, index));
    let injector = Injector::new(&setup.faults, episode_seed(plan.seed, Use::Faults, index));
    let mut tally = Tally::default();
    let mut tallied = |record: &Record| {
        tally.add(record);
        sink(record);
    };
    let mut robot = Robot::new((plan, setup, hold), plant, start.sections(), injector, &mut tallied);
    robot.injector.begin(0);
    let scene = robot.scene();
    let mut agenda = Agenda::new();
    agenda.at(robot.step_end(), Event::Step);

    let mut seed = episode_seed(plan.seed, Use::Controller, index);
    let mut state = (plan.limit.cost(), CostMeter::new(worst_cost()));
    let mut host_times = Vec::new();
    let mut is_first = true;
    let is_alive = loop {
        let Some(mut journal) = open(device, setup) else { break false };
        if std::mem::take(&mut is_first) {
            // On failure the episode goes on with what the one before left.
            let _ = journal.begin(plan.limit.cost());
        } else {
            state = (journal.remaining(), CostMeter::resumed(worst_cost()));
        }
        let mut journal = Some(journal);
        agenda.at(agenda.now(), Event::Sample);
        agenda.at(agenda.now() + setup.watchdog, Event::Watchdog);
        let image = PolicyImage::new_checked(device.memory.as_slice()).map_err(|_| FlightError::Image)?;
        let mut firmware = Firmware::booted((plan, setup, hold), &image, state, (agenda.now(), seed));
        let mut working = device.memory.clone();
        let end = loop {
            let image = PolicyImage::new_checked(working.as_slice()).map_err(|_| FlightError::Image)?;
            match firmware.fly(&image, seed, (&mut robot, &mut agenda), &mut journal)? {
                End::RamFlip(draw) => {
                    let flipped = flipped(&working, draw);
                    match PolicyImage::new_checked(flipped.as_slice()).is_ok() {
                        true => {
                            working = flipped;
                            firmware.set_weights(Weights::Changed);
                        }
                        false => firmware.set_weights(Weights::Broken),
                    }
                    // The chains' noise must not begin anew.
                    seed = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
                }
                end => break end,
            }
        };
        host_times.append(&mut firmware.host_times);
        let Some(journal) = journal else { break false };
        let mut flash = journal.into_flash();
        flash.restore_power();
        for [choice, bit] in robot.flash_flips.drain(..) {
            let image_bits = 8 * device.memory.as_slice().len() as u32;
            flash.flip(match choice % 3 {
                0 => Chip::slot_bit(Slot::A) + below(bit, image_bits) as usize,
                1 => Chip::slot_bit(Slot::B) + below(bit, image_bits) as usize,
                _ => 8 * JOURNAL.start as usize + below(bit, 8 * (JOURNAL.end - JOURNAL.start)) as usize,
            });
        }
        device.chip = Chip::with_flash(flash).ok_or(FlightError::Image)?;
        let End::Reset(off) = end else { break true };
        robot.note(Notice::Reset);
        robot.set_down(true);
        agenda.retain(|event| *event == Event::Step);
        agenda.at(agenda.now() + off + setup.boot, Event::Booted);
        if !wait(&mut robot, &mut agenda) {
            break true;
        }
        match device.chip.boot() {
            Ok(boot) => {
                if boot.passed_over.is_some() {
                    robot.note(Notice::Slot);
                }
                device.memory = boot.image;
            }
            Err(_) => {
                robot.note(Notice::Slot);
                break false;
            }
        }
        robot.set_down(false);
        seed = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
    };
    while !robot.is_done() {
        robot.advance();
    }
    let verdict = robot.referee.verdict();
    let goals = std::mem::take(&mut robot.goals);
    (tally.budget_errors, tally.actions_out_of_range) = verdict;
    Ok(Ended { episode: RobotEpisode { records: Vec::new(), scene, goals }, tally, host_times, is_alive })
}

/// The plant goes on while the controller boots; whether the episode does.
fn wait(robot: &mut Robot<'_>, agenda: &mut Agenda<Event>) -> bool {
    while let Some(event) = agenda.next() {
        if event == Event::Booted {
            return true;
        }
        robot.advance();
        if robot.is_done() {
            return false;
        }
        agenda.at(robot.step_end(), Event::Step);
    }
    false
}

/// Opens the journal on the device's flash, which it keeps until the reset.
fn open(device: &mut Device, setup: &Setup) -> Option<Journal<crate::flash::NorModel>> {
    let chip = std::mem::replace(&mut device.chip, Chip::blank());
    Journal::open(chip.into_flash(), JOURNAL, setup.reserve).ok()
}

/// Steps of each rung that a plan allows and the longest that it takes, longest chain first.
fn rung_times(image: &PolicyImage<'_>, setup: &Setup, max_steps: usize) -> Vec<(usize, Duration)> {
    let Ok(policy) = Policy::load(image) else { return Vec::new() };
    let worst = |rung| setup.board.and_then(|board| board.action(image, rung)).map_or(Duration::ZERO, |a| a.worst);
    let rungs = policy.rungs().enumerate().map(|(rung, steps)| (steps, worst(rung)));
    rungs.filter(|(steps, _)| *steps <= max_steps).collect()
}

/// The bounds of each action entry.
fn action_bounds(sections: &Sections<'_>) -> Vec<(f32, f32)> {
    sections.action_low.iter().copied().zip(sections.action_high.iter().copied()).collect()
}

fn worst_cost() -> Cost {
    Cost::from_incurred(WORST_COST).unwrap_or(Cost::MAX)
}

/// An image with one bit of its weights flipped, and its checksums made right:
/// what flies on is what RAM holds, not what was checked.
fn flipped(memory: &AlignedBytes, draw: u32) -> AlignedBytes {
    let mut bytes = memory.clone();
    let Ok(image) = PolicyImage::new_checked(memory.as_slice()) else { return bytes };
    let sections = &image.manifest().sections;
    let range = |kind| sections.iter().find(|section| section.kind == kind).map(|s| s.offset..s.offset + s.length);
    let (Some(first), Some(last)) = (range(SectionKind::Kappa1), range(SectionKind::Output)) else { return bytes };
    let end = sections.iter().map(|section| section.offset + section.length).max().unwrap_or(0);
    let body = memory.as_slice().len() - end as usize;
    let bit = body * 8 + (8 * first.start + below(draw, 8 * (last.end - first.start))) as usize;
    let memory = bytes.as_mut_slice();
    memory[bit / 8] ^= 1 << (bit % 8);
    seal(memory);
    bytes
}

/// Makes the checksums of an image right (`docs/image-format.md`, header).
fn seal(image: &mut [u8]) {
    const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
    let payload = CRC.checksum(&image[HEADER_BYTES..]);
    image[16..20].copy_from_slice(&payload.to_le_bytes());
    let header = CRC.checksum(&image[..28]);
    image[28..32].copy_from_slice(&header.to_le_bytes());
}

#[cfg(test)]
mod tests;
