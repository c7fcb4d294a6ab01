//! `firmware-sim soak`

use std::fmt;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use armor_core::units::CostLimit;
use serde::Serialize;

use super::BoardChoice;
use super::output::{CommandResult, Output};
use crate::flight::FlightPlan;
use crate::harness::soak::{SoakPlan, Soaked, soak};
use crate::image_file::ImageFile;
use crate::summary::HOST;
use crate::task::Task;

/// Shares at which progress is told.
const NOTES: u32 = 10;

/// Fly an image for virtual hours, under faults drawn anew for each episode.
///
/// Fails if an action out of range comes to the actuators, or a budget is
/// larger than it may be. Tells how worn the budget's journal would be in a year.
#[derive(Debug, clap::Args)]
pub(super) struct Soak {
    /// The policy image.
    image: PathBuf,
    /// The task to fly.
    #[arg(long, value_parser = super::task)]
    task: &'static Task,
    /// What computes the actions: this host, at once, or a board, by its model.
    #[arg(long, default_value = HOST, value_parser = super::board)]
    board: BoardChoice,
    /// Virtual hours to fly.
    #[arg(long, default_value_t = 8.0, value_parser = hours)]
    hours: f64,
    /// Cost that an episode may incur; the paper's limit for the task, if not given.
    #[arg(long, value_name = "D", value_parser = super::limit)]
    limit: Option<CostLimit>,
    /// Calls of the denoiser that an action may take; no limit, if not given.
    #[arg(long, value_name = "N", default_value_t = usize::MAX, hide_default_value = true)]
    max_steps: usize,
    /// Decides starts, noise and faults.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Inject nothing: what a year of quiet flight wears.
    #[arg(long)]
    no_faults: bool,
}

#[derive(Serialize)]
struct Report {
    task: &'static str,
    board: &'static str,
    rate_hz: u32,
    cost_limit: f32,
    seed: u64,
    #[serde(flatten)]
    soaked: Soaked,
    seconds: f64,
}

fn hours(text: &str) -> Result<f64, &'static str> {
    // A year, for what takes longer will not be waited for.
    text.parse().ok().filter(|hours| *hours > 0.0 && *hours <= 8766.0).ok_or("give hours, above 0 and at most 8766")
}

impl Soak {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let file = ImageFile::read(&self.image)?;
        let image = file.image()?;
        let task = self.task;
        task.plant()?;
        let limit = self.limit.map_or_else(|| CostLimit::new(task.cost_limit), Ok)?;
        let (seed, max_steps, rate_hz) = (self.seed, self.max_steps, task.rate_hz);
        let plan = FlightPlan { task, limit, episodes: 1, seed, rate_hz, max_steps };
        let plan = SoakPlan {
            image: image.bytes(),
            plan,
            board: self.board,
            time: Duration::from_secs_f64(3600.0 * self.hours),
            with_faults: !self.no_faults,
        };
        let started = Instant::now();
        let mut told = 0;
        let soaked = soak(&plan, &mut |share| {
            let tenths = (share * f64::from(NOTES)) as u32;
            if tenths > told {
                told = tenths;
                output.note(format_args!("{:>3} %, {:.0} s", 100 * told / NOTES, started.elapsed().as_secs_f64()));
            }
        })?;
        let board = self.board.map_or(HOST, |board| board.name);
        let seconds = started.elapsed().as_secs_f64();
        let cost_limit = limit.cost().to_f32();
        let report = Report { task: task.name, board, rate_hz, cost_limit, seed, soaked, seconds };
        output.report(&report)?;
        let tally = &report.soaked.tally;
        match (tally.actions_out_of_range, tally.budget_errors) {
            (0, 0) => Ok(()),
            (range, budget) => {
                Err(format!("{range} actions out of range and {budget} budget errors; do not fly this, report it")
                    .into())
            }
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { soaked, .. } = self;
        writeln!(
            f,
            "{} on {} at {} Hz, cost limit {}, seed {}",
            self.task, self.board, self.rate_hz, self.cost_limit, self.seed
        )?;
        writeln!(f, "virtual time        {:>10.2} hours, {} control steps", soaked.hours, soaked.tally.steps)?;
        writeln!(f, "episodes in limit   {:>10} of {}", soaked.safe_episodes, soaked.episodes)?;
        writeln!(f, "chips flashed anew  {:>10}", soaked.dead_chips)?;
        let (erases, year) = (soaked.journal_erases, soaked.journal_erases_per_year);
        writeln!(f, "journal             {erases:>10} erases of a block, {year:.0} in a year")?;
        writeln!(f, "{}", soaked.tally)?;
        write!(f, "took                {:>10.1} s", self.seconds)
    }
}
