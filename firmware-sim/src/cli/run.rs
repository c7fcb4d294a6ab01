//! `firmware-sim run`

use std::fmt;
use std::path::PathBuf;

use armor_core::image::PolicyImage;
use armor_core::units::CostLimit;
use serde::Serialize;

use super::output::{CommandResult, Output};
use crate::chip::{Chip, Slot};
use crate::file;
use crate::flight::{FlightPlan, check, fly};
use crate::latency::Latency;
use crate::summary::FlightSummary;
use crate::task::Task;
use crate::telemetry;

/// Boot a chip and fly its policy on a native task.
#[derive(Debug, clap::Args)]
pub(super) struct Run {
    /// The chip file.
    #[arg(long)]
    chip: PathBuf,
    /// The task to fly.
    #[arg(long, value_parser = super::task)]
    task: &'static Task,
    /// What computes the actions.
    #[arg(long, default_value = "host")]
    board: Board,
    /// Control steps a second: the task's rate, which is the default, or a
    /// whole fraction of it.
    #[arg(long, value_name = "HZ")]
    rate: Option<u32>,
    /// Calls of the denoiser that an action may take, which picks the rung; no
    /// limit, if not given.
    #[arg(long, value_name = "N", default_value_t = usize::MAX, hide_default_value = true)]
    max_steps: usize,
    /// Cost that an episode may incur; the paper's limit for the task, if not given.
    #[arg(long, value_name = "D", value_parser = super::limit)]
    limit: Option<CostLimit>,
    /// Episodes to fly.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..))]
    episodes: u32,
    /// Decides the starts and the noise.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Write telemetry to this CSV file.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// What computes the actions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
enum Board {
    /// This computer.
    Host,
}

#[derive(Serialize)]
struct Report {
    board: Board,
    slot: Slot,
    image_bytes: usize,
    golden_rows: usize,
    #[serde(flatten)]
    summary: FlightSummary,
    telemetry: Option<PathBuf>,
    #[serde(skip)]
    latency: Latency,
}

impl Run {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let task = self.task;
        task.plant()?;
        let limit = self.limit.map_or_else(|| CostLimit::new(task.cost_limit), Ok)?;
        let rate_hz = self.rate.unwrap_or(task.rate_hz);
        let plan =
            FlightPlan { task, limit, episodes: self.episodes, seed: self.seed, rate_hz, max_steps: self.max_steps };

        let mut chip = Chip::read(&self.chip)?;
        let boot = chip.boot();
        if let Ok(boot) = &boot {
            // A flight that cannot start must not end the trial of a good policy.
            check(&PolicyImage::new_checked(boot.image.as_slice())?, &plan)?;
        }
        chip.write(&self.chip)?;
        let boot = boot?;
        if let Some(fault) = boot.passed_over {
            output.note(format_args!("slot {} passed over: {fault}", boot.slot.other()));
        }
        output.note(format_args!("booted slot {}, {} golden rows bit for bit", boot.slot, boot.golden_rows));
        let image = PolicyImage::new_checked(boot.image.as_slice())?;
        let flight = fly(&image, &plan)?;
        if boot.on_trial {
            chip.confirm()?;
            chip.write(&self.chip)?;
            output.note(format_args!("slot {} flew its trial and is confirmed", boot.slot));
        }
        if let Some(path) = &self.output {
            file::write(path, telemetry::csv(&flight, task.action).as_bytes())?;
        }
        output.report(&Report {
            board: self.board,
            slot: boot.slot,
            image_bytes: image.bytes().len(),
            golden_rows: boot.golden_rows,
            summary: flight.summary,
            telemetry: self.output,
            latency: flight.latency,
        })
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.summary)?;
        if let Some(path) = &self.telemetry {
            writeln!(f, "telemetry           {}", path.display())?;
        }
        write!(f, "\nhost latency of an action\n{}", self.latency.to_string().trim_end())
    }
}
