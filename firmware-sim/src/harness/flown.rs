//! All episodes of a plan, with their scores.

use std::time::Duration;

use armor_core::image::PolicyImage;
use armor_infer::Step;

use super::record::{Notice, Record, RobotEpisode};
use super::{Device, Setup, Tally, fly};
use crate::flight::{Episode, FlightError, FlightPlan, Tick, check};
use crate::latency::Latency;
use crate::summary::{FlightSummary, HOST};

/// A flight of a robot.
#[derive(Clone, Debug)]
pub struct RobotFlight {
    /// Its episodes, with every control step.
    pub episodes: Vec<RobotEpisode>,
    /// What was counted.
    pub tally: Tally,
    /// What the controller took: measured on the host, modelled on a board.
    pub latency: Latency,
    /// Scores and quantiles.
    pub summary: FlightSummary,
}

/// Flies the episodes of a plan from number `first` on, or those until the
/// chip no longer boots.
///
/// # Errors
/// [`FlightError`]
pub fn fly_all(device: &mut Device, plan: &FlightPlan, setup: &Setup, first: u32) -> Result<RobotFlight, FlightError> {
    check(&PolicyImage::new_checked(device.image()).map_err(|_| FlightError::Image)?, plan)?;
    let (mut episodes, mut tallies, mut latencies) = (Vec::new(), Vec::new(), Vec::new());
    for index in (first..).take(plan.episodes as usize) {
        let mut records = Vec::new();
        let ended = fly(device, plan, setup, index, &mut |record| records.push(*record))?;
        latencies.extend(match setup.board {
            None => ended.host_times,
            Some(_) => records.iter().filter_map(|record| record.latency).collect(),
        });
        episodes.push(RobotEpisode { records, ..ended.episode });
        tallies.push(ended.tally);
        if !ended.is_alive {
            break;
        }
    }
    let latency: Latency = latencies.into_iter().collect();
    let tally: Tally = tallies.into_iter().sum();
    let scored: Vec<Episode> = episodes.iter().map(|episode| scored(&episode.records)).collect();
    let summary = FlightSummary {
        board: setup.board.map_or(HOST, |board| board.name),
        deadline_misses: tally.notices(Notice::Late) + tally.notices(Notice::Skipped),
        ..FlightSummary::new(&FlightPlan { episodes: scored.len() as u32, ..*plan }, &scored, &latency)
    };
    Ok(RobotFlight { episodes, tally, latency, summary })
}

/// An episode as flights are scored.
fn scored(records: &[Record]) -> Episode {
    let tick = |record: &Record| {
        let Record { time, action, rung, fault, reward, cost, .. } = *record;
        let step = Step { action, kappa: record.kappa.unwrap_or_default(), rung, fault };
        Tick { time, step, reward, cost, latency: record.latency.unwrap_or(Duration::ZERO) }
    };
    Episode { ticks: records.iter().map(tick).collect(), goals: None }
}
