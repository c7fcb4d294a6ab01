//! `firmware-sim run`

use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

use armor_core::image::PolicyImage;
use armor_core::units::CostLimit;
use serde::Serialize;

use super::BoardChoice;
use super::output::{CommandResult, Output};
use crate::chip::{Chip, Slot};
use crate::fault::Injection;
use crate::file;
use crate::flight::{FlightPlan, check};
use crate::harness::{Device, RobotFlight, Setup, Tally, fly_all};
use crate::host::{self, HostController};
use crate::latency::Latency;
use crate::page::flight::{self, Told};
use crate::summary::{FlightSummary, HOST};
use crate::task::Task;
use crate::telemetry;

/// Boot a chip and fly its policy on a native task.
///
/// Time is virtual: on a board, an action takes as long as the board's model
/// says, and the longest chain that ends in time flies.
#[derive(Debug, clap::Args)]
pub(super) struct Run {
    /// The chip file.
    #[arg(long)]
    chip: PathBuf,
    /// The task to fly.
    #[arg(long, value_parser = super::task)]
    task: &'static Task,
    /// What computes the actions: this host, at once, or a board, by its model
    /// (stm32f407, stm32f746, stm32h743, nrf52840, nrf5340, rp2040, rp2350, esp32-c3).
    #[arg(long, default_value = HOST, value_parser = super::board)]
    board: BoardChoice,
    /// Control steps a second: the task's rate, which is the default, or a
    /// whole fraction of it.
    #[arg(long, value_name = "HZ")]
    rate: Option<u32>,
    /// Calls of the denoiser that an action may take, which picks the rung; no
    /// limit, if not given.
    #[arg(long, value_name = "N", default_value_t = usize::MAX, hide_default_value = true)]
    max_steps: usize,
    /// Candidates for each action, of which the image's critic takes the best:
    /// 1, 2, 4, 8 or 16.
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = super::candidates)]
    best_of: u8,
    /// Cost that an episode may incur; the paper's limit for the task, if not given.
    #[arg(long, value_name = "D", value_parser = super::limit)]
    limit: Option<CostLimit>,
    /// Episodes to fly.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..))]
    episodes: u32,
    /// Number of the first episode: each starts, and is disturbed, as the seed
    /// and its number say.
    #[arg(long, value_name = "N", default_value_t = 0)]
    first: u32,
    /// Decides the starts, the noise and the faults.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// A fault to inject, as often as you like: sensor-nan, cost-lost, brown-out
    /// and others (docs/faults.md), with a severity if the usual one will not do.
    #[arg(long, value_name = "NAME[=SEVERITY]")]
    fault: Vec<Injection>,
    /// Time in us that a sample travels to the controller, and an action to the
    /// actuators.
    #[arg(long, value_name = "US", default_value_t = 0)]
    transport_us: u64,
    /// Write telemetry to FILE.csv, or a page to FILE.html; both, if given twice.
    #[arg(short, long, value_name = "FILE", value_parser = written)]
    output: Vec<Written>,
}

/// A file to write, by its extension.
#[derive(Clone, Debug)]
enum Written {
    Telemetry(PathBuf),
    Page(PathBuf),
}

#[derive(Serialize)]
struct Report {
    slot: Slot,
    image_bytes: usize,
    golden_rows: usize,
    #[serde(flatten)]
    summary: FlightSummary,
    faults_injected: Vec<Injection>,
    tally: Tally,
    telemetry: Option<PathBuf>,
    page: Option<PathBuf>,
    #[serde(skip)]
    latency: Latency,
}

fn written(name: &str) -> Result<Written, &'static str> {
    let path = PathBuf::from(name);
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("csv") => Ok(Written::Telemetry(path)),
        Some("html") => Ok(Written::Page(path)),
        _ => Err("name it .csv for telemetry or .html for a page"),
    }
}

impl Run {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let task = self.task;
        task.plant()?;
        if self.board.is_some() && self.best_of > 1 {
            return Err("the boards' models time a single action; fly the best of several on the host".into());
        }
        if self.first.checked_add(self.episodes).is_none() {
            return Err(
                format!("no episode is numbered above {}; fly an earlier --first or fewer", u32::MAX - 1).into()
            );
        }
        let limit = self.limit.map_or_else(|| CostLimit::new(task.cost_limit), Ok)?;
        let rate_hz = self.rate.unwrap_or(task.rate_hz);
        let plan =
            FlightPlan { task, limit, episodes: self.episodes, seed: self.seed, rate_hz, max_steps: self.max_steps };

        let mut chip = Chip::read(&self.chip)?;
        let boot = chip.boot();
        if let Ok(boot) = &boot {
            // A flight that cannot start must not end the trial of a good policy.
            let image = PolicyImage::new_checked(boot.image.as_slice())?;
            check(&image, &plan)?;
            if let Some(board) = self.board {
                board.check_fit(image.bytes().len(), HostController::RAM_BYTES)?;
            }
            host::pilot(&image, plan.limit, 0, self.best_of)?;
        }
        chip.write(&self.chip)?;
        let boot = boot?;
        if let Some(fault) = boot.passed_over {
            output.note(format_args!("slot {} passed over: {fault}", boot.slot.other()));
        }
        output.note(format_args!("booted slot {}, {} golden rows bit for bit", boot.slot, boot.golden_rows));
        let image = PolicyImage::new_checked(boot.image.as_slice())?;
        let setup = Setup::new(&plan, &image, self.board, self.fault.clone())
            .with_transport(&plan, Duration::from_micros(self.transport_us))
            .with_candidates(self.best_of);
        if setup.steps_in_time(&plan, &image) == 0 {
            output.note("no chain ends in time, so the fallback will fly; export in integers, lower");
            output.note("--rate or choose a faster --board");
        }
        let mut device = Device::new(chip, &boot);
        let flight = fly_all(&mut device, &plan, &setup, self.first)?;
        let mut chip = device.into_chip();
        if boot.on_trial {
            chip.confirm()?;
            output.note(format_args!("slot {} flew its trial and is confirmed", boot.slot));
        }
        chip.write(&self.chip)?;
        let (mut telemetry, mut page) = (None, None);
        for file in &self.output {
            match file {
                Written::Telemetry(path) => {
                    let records: Vec<_> = flight.episodes.iter().map(|episode| episode.records.clone()).collect();
                    file::write(path, telemetry::csv(&records, task.action).as_bytes())?;
                    telemetry = Some(path.clone());
                }
                Written::Page(path) => {
                    let told = Told { flight: &flight, plan: &plan, setup: &setup, image: &image };
                    file::write(path, flight::page(&told).as_bytes())?;
                    page = Some(path.clone());
                }
            }
        }
        let RobotFlight { tally, latency, summary, .. } = flight;
        let [range, budget] = [tally.actions_out_of_range, tally.budget_errors];
        output.report(&Report {
            slot: boot.slot,
            image_bytes: image.bytes().len(),
            golden_rows: boot.golden_rows,
            summary,
            faults_injected: self.fault,
            tally,
            telemetry,
            page,
            latency,
        })?;
        super::unbroken(range, budget)
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.summary)?;
        writeln!(f, "{}", self.tally)?;
        for (what, path) in [("telemetry", &self.telemetry), ("page", &self.page)] {
            if let Some(path) = path {
                writeln!(f, "{what:<20}{}", path.display())?;
            }
        }
        match self.latency.to_string().trim_end() {
            "" => write!(f, "\nno chain answered"),
            histogram => write!(f, "\n{} of an action\n{histogram}", self.summary.latency_of()),
        }
    }
}
