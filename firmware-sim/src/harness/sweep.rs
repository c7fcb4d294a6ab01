//! Every fault at three severities, over seeds.

use serde::Serialize;

use super::{Device, NotFlashed, Setup, Tally, fly};
use crate::board::Board;
use crate::fault::{FaultKind, Injection};
use crate::flight::{FlightError, FlightPlan};
use crate::task;
use armor_core::image::PolicyImage;
use thiserror::Error;

/// What to fly under every fault.
#[derive(Clone, Copy, Debug)]
pub struct SweepPlan<'a> {
    /// The image.
    pub image: &'a [u8],
    /// Each flight; its seed is the first.
    pub plan: FlightPlan,
    /// Flights of each fault and severity, with a seed and a new chip each.
    pub seeds: u32,
    /// What computes the actions.
    pub board: Option<&'static Board>,
}

/// What a fault at a severity did.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SweepRow {
    /// The fault; none in the first row.
    pub fault: Option<Injection>,
    /// Mean normalised return of its episodes (Eq. 17).
    pub reward_normalized: f64,
    /// Mean normalised cost return.
    pub cost_normalized: f64,
    /// Episodes flown.
    pub episodes: u32,
    /// Those that stayed within the limit.
    pub safe_episodes: u32,
    /// Chips that no longer booted, and were flashed anew.
    pub dead_chips: u32,
    /// What was counted.
    pub tally: Tally,
}

/// Why a sweep ended.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SweepError {
    /// The image is not flown by a new chip.
    #[error(transparent)]
    Flash(#[from] NotFlashed),
    /// The policy cannot fly the task.
    #[error(transparent)]
    Flight(#[from] FlightError),
}

/// Rows of a sweep: without a fault, then each fault from mild to hard.
pub fn injections() -> impl Iterator<Item = Option<Injection>> {
    let each = |kind: FaultKind| kind.severities().map(|severity| Some(Injection { kind, severity }));
    std::iter::once(None).chain(FaultKind::ALL.into_iter().flat_map(each))
}

/// Flies one row; the chip is switched off after each episode.
///
/// # Errors
/// [`SweepError`]
pub fn row(sweep: &SweepPlan<'_>, fault: Option<Injection>) -> Result<SweepRow, SweepError> {
    let SweepPlan { image, plan, seeds, board } = *sweep;
    let limit = f64::from(plan.limit.cost().to_f32());
    let (mut tallies, mut dead_chips) = (Vec::new(), 0);
    for seed in 0..seeds {
        let plan = FlightPlan { seed: plan.seed + u64::from(seed), ..plan };
        let mut device = Device::flashed(image)?;
        let checked = PolicyImage::new_checked(image).map_err(|_| FlightError::Image)?;
        let setup = Setup::new(&plan, &checked, board, fault.into_iter().collect());
        for index in 0..plan.episodes {
            let ended = fly(&mut device, &plan, &setup, index, &mut |_| ())?;
            let mut tally = ended.tally;
            match device.reboot() {
                Ok(passed_over) if ended.is_alive => tally.note_slot(passed_over),
                _ => {
                    dead_chips += 1;
                    tally.note_slot(true);
                    device = Device::flashed(image)?;
                }
            }
            tallies.push(tally);
        }
    }
    let mean = |of: &dyn Fn(&Tally) -> f64| tallies.iter().map(of).sum::<f64>() / tallies.len().max(1) as f64;
    Ok(SweepRow {
        fault,
        reward_normalized: mean(&|tally| plan.task.reward_normalized(tally.reward)),
        cost_normalized: mean(&|tally| task::cost_normalized(tally.cost, limit)),
        episodes: tallies.len() as u32,
        safe_episodes: tallies.iter().filter(|tally| tally.cost <= limit).count() as u32,
        dead_chips,
        tally: tallies.into_iter().sum(),
    })
}
