//! Hours of flight under faults that change from episode to episode.

use std::time::Duration;

use armor_core::image::PolicyImage;
use armor_core::noise::{Noise, below};
use serde::Serialize;

use super::sweep::SweepError;
use super::{Device, Setup, Tally, fly};
use crate::board::Board;
use crate::chip::{Chip, JOURNAL};
use crate::fault::{FaultKind, Injection};
use crate::flash::WRITE_BYTES;
use crate::flight::{FlightError, FlightPlan, Use, episode_seed};

/// A fault is there in one of so many episodes.
const RARITY: u32 = 4;
/// Hours of a year.
const YEAR: f64 = 24.0 * 365.25;

/// What to fly, and for how long.
#[derive(Clone, Copy, Debug)]
pub struct SoakPlan<'a> {
    /// The image.
    pub image: &'a [u8],
    /// Each flight; its number of episodes does not count.
    pub plan: FlightPlan,
    /// What computes the actions.
    pub board: Option<&'static Board>,
    /// Virtual time to fly.
    pub time: Duration,
    /// Whether faults are injected.
    pub with_faults: bool,
}

/// What hours of flight brought.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Soaked {
    /// Episodes flown.
    pub episodes: u32,
    /// Those within the limit.
    pub safe_episodes: u32,
    /// Chips that no longer booted, and were flashed anew.
    pub dead_chips: u32,
    /// Virtual hours.
    pub hours: f64,
    /// Erases of each block of the journal that its records come to, over all chips.
    pub journal_erases: f64,
    /// The same in a year of this.
    pub journal_erases_per_year: f64,
    /// What was counted.
    pub tally: Tally,
    /// Episodes with a budget error or an action out of range; there must be none.
    pub breaches: Vec<Breach>,
    /// The chip as it was before the first of them.
    #[serde(skip)]
    pub breached: Option<Chip>,
}

/// An episode in which something was found that must not be.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Breach {
    /// Its index among the episodes of the soak.
    pub episode: u32,
    /// The faults that were injected.
    pub faults: Vec<Injection>,
    /// Budgets that grew, or were above what was left.
    pub budget_errors: u64,
    /// Actions beyond the policy's bounds that came to the actuators.
    pub actions_out_of_range: u64,
}

/// Flies until the time is over. The chip is switched off after each episode;
/// `progress` is told the share that is done.
///
/// # Errors
/// [`SweepError`]
pub fn soak(soak: &SoakPlan<'_>, progress: &mut dyn FnMut(f64)) -> Result<Soaked, SweepError> {
    let SoakPlan { image, plan, board, time, with_faults } = *soak;
    let checked = PolicyImage::new_checked(image).map_err(|_| FlightError::Image)?;
    let mut setup = Setup::new(&plan, &checked, board, Vec::new());
    let wanted = (time.as_secs_f64() * f64::from(plan.rate_hz)).ceil() as u64;
    let limit = f64::from(plan.limit.cost().to_f32());
    let mut device = Device::flashed(image)?;
    let mut soaked = Soaked::default();
    let (mut words, mut before) = (0, device.chip().operations());
    while soaked.tally.steps < wanted {
        if with_faults {
            setup.faults = drawn(episode_seed(plan.seed, Use::Mixture, soaked.episodes));
        }
        let chip = device.chip().clone();
        let ended = fly(&mut device, &plan, &setup, soaked.episodes, &mut |_| ())?;
        let Tally { budget_errors, actions_out_of_range, .. } = ended.tally;
        if budget_errors + actions_out_of_range > 0 {
            let (episode, faults) = (soaked.episodes, setup.faults.clone());
            soaked.breaches.push(Breach { episode, faults, budget_errors, actions_out_of_range });
            soaked.breached.get_or_insert(chip);
        }
        soaked.episodes += 1;
        soaked.safe_episodes += u32::from(ended.tally.cost <= limit);
        let mut tally = ended.tally;
        match device.reboot() {
            Ok(passed_over) if ended.is_alive => tally.note_slot(passed_over),
            _ => {
                tally.note_slot(true);
                soaked.dead_chips += 1;
                words += device.chip().operations() - before;
                device = Device::flashed(image)?;
                before = device.chip().operations();
            }
        }
        soaked.tally = [std::mem::take(&mut soaked.tally), tally].into_iter().sum();
        progress(soaked.tally.steps as f64 / wanted.max(1) as f64);
    }
    soaked.hours = soaked.tally.steps as f64 / f64::from(plan.rate_hz) / 3600.0;
    words += device.chip().operations() - before;
    // But for an erase here and there, and the boot log's, these are words of the journal, which goes round.
    soaked.journal_erases = words as f64 * WRITE_BYTES as f64 / JOURNAL.len() as f64;
    soaked.journal_erases_per_year = soaked.journal_erases * YEAR / soaked.hours;
    Ok(soaked)
}

/// The faults of an episode.
fn drawn(seed: u64) -> Vec<Injection> {
    let noise = Noise::new(seed);
    let drawn = FaultKind::ALL.into_iter().filter_map(|kind| {
        let [is_there, severity, ..] = noise.words(0, 0, kind as u32);
        let severity = kind.severities()[below(severity, 3) as usize];
        (below(is_there, RARITY) == 0).then_some(Injection { kind, severity })
    });
    drawn.collect()
}
