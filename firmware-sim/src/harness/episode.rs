//! An episode from its first sample to its last step, over all resets in between.

use std::time::Duration;

use armor_core::image::PolicyImage;
use armor_core::noise::below;
use armor_infer::journal::Journal;
use armor_infer::meter::CostMeter;

use super::clock::Agenda;
use super::firmware::{End, Event, Firmware, Weights};
use super::flip::flipped;
use super::record::{Notice, Record, RobotEpisode};
use super::robot::Robot;
use super::setup::{Setup, worst_cost};
use super::{Device, Tally};
use crate::chip::{Chip, JOURNAL, Slot};
use crate::fault::Injector;
use crate::flight::{FlightError, FlightPlan, Use, check, episode_seed};

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
