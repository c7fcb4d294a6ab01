//! `armor-train quickstart`: data, training, export, flash, flight, proof.

use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Instant;

use armor_core::image::PolicyImage;
use armor_core::units::CostLimit;
use firmware_sim::calibrate::CalibrationReport;
use firmware_sim::chip::Chip;
use firmware_sim::cli::output::{CommandResult, Output};
use firmware_sim::file;
use firmware_sim::flight::{FlightPlan, fly};
use firmware_sim::latency::Latency;
use firmware_sim::summary::FlightSummary;
use firmware_sim::task::Task;
use firmware_sim::verify::verify;
use serde::Serialize;

use super::fit::{absolute, train};
use crate::config::Preset;
use crate::data::{Dataset, Stats, Unfinished};
use crate::export::{Agreement, export};
use crate::run::{Checkpoint, Outcome};

/// The recording that ships with the project.
const RECORDING: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../data/ball-run-bullet.hdf5");
const TASK: &str = "ball-run";
const EPISODES: u32 = 20;

/// Recorded data in, a policy flying on a simulated controller out.
///
/// Trains the `quick` preset on the recorded ball-run data with three seeds,
/// exports each policy, flashes it to a simulated chip, boots it, flies 20
/// episodes at cost limit 5, and checks that what flies is what was trained.
/// Stopped and started again, it goes on where it was.
#[derive(Debug, clap::Args)]
pub(super) struct Quickstart {
    /// Folder for all that is made.
    #[arg(long, value_name = "DIR", default_value = "quickstart")]
    out: PathBuf,
    /// The recorded data.
    #[arg(long, default_value = RECORDING, hide_default_value = true)]
    data: PathBuf,
    /// Training seeds.
    #[arg(long, value_delimiter = ',', default_values_t = [0, 1, 2], value_parser = clap::value_parser!(u64).range(..1 << 63))]
    seeds: Vec<u64>,
    /// Training steps for each seed; the preset's, if not given.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
}

#[derive(Serialize)]
struct Report {
    data: Stats,
    plant: CalibrationReport,
    seeds: Vec<SeedReport>,
    safe_seeds: usize,
    seconds: f64,
    out: PathBuf,
    #[serde(skip)]
    latency: Latency,
}

#[derive(Serialize)]
struct SeedReport {
    training_seed: u64,
    image: PathBuf,
    image_bytes: usize,
    chip: PathBuf,
    golden_rows: usize,
    verified: bool,
    train_seconds: f64,
    #[serde(flatten)]
    agreement: Agreement,
    #[serde(flatten)]
    flight: FlightSummary,
    #[serde(skip)]
    latency: Latency,
}

impl Quickstart {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let started = Instant::now();
        let task = Task::named(TASK)?;
        let limit = CostLimit::new(task.cost_limit)?;

        output.note("recorded data (recorded for this project, DSRL layout)");
        let data = super::data::read(&self.data, Unfinished::Drop, output)?;
        let stats = Stats::new(&data, limit, Preset::Quick.config(TASK, 0.0).beta);
        output.note(format_args!("{stats}\n"));
        let plant = super::data::calibrate(&data, task)?;
        output.note(format_args!("{plant}\n"));

        let mut seeds = Vec::new();
        let mut latencies = Vec::new();
        for &seed in &self.seeds {
            let report = self.seed(seed, task, limit, &data, output)?;
            output.note(format_args!("{report}"));
            latencies.push(report.latency.clone());
            seeds.push(report);
        }
        let safe_seeds = seeds.iter().filter(|seed| seed.flight.cost_normalized <= 1.0).count();
        let failed = seeds.iter().find(|seed| !seed.verified).map(|seed| seed.image.clone());
        output.report(&Report {
            data: stats,
            plant,
            seeds,
            safe_seeds,
            seconds: started.elapsed().as_secs_f64(),
            out: self.out,
            latency: latencies.into_iter().sum(),
        })?;
        match failed {
            Some(image) => Err(format!("{} fails firmware-sim verify", image.display()).into()),
            None => Ok(()),
        }
    }

    /// One seed: train, export, flash, boot, fly, verify.
    fn seed(
        &self,
        seed: u64,
        task: &'static Task,
        limit: CostLimit,
        data: &Dataset,
        output: Output,
    ) -> Result<SeedReport, Box<dyn std::error::Error>> {
        let folder = self.out.join(format!("seed-{seed}"));
        let mut config = Preset::Quick.config(TASK, f64::from(task.cost_limit));
        config.seed = seed;
        config.steps = self.steps.unwrap_or(config.steps);
        config.data = absolute(&self.data);
        let started = Instant::now();
        let resume = folder.join(Checkpoint::FILE).exists();
        let outcome = train(&format!("seed {seed}"), &config, data, &folder, resume, output)?;
        if let Outcome::Stopped(step) = outcome {
            return Err(format!("stopped and saved seed {seed} at step {step}; the same command goes on").into());
        }
        let train_seconds = started.elapsed().as_secs_f64();

        let checkpoint = Checkpoint::read(&folder)?;
        let exported = export(&checkpoint, data, None)?;
        let (image, chip) = (folder.join("policy.armor"), folder.join("chip.bin"));
        file::write(&image, exported.bytes.as_slice())?;
        let booted = flash_and_boot(exported.bytes.as_slice(), &chip)?;

        let policy = PolicyImage::new_checked(booted.image.as_slice())?;
        let plan = FlightPlan { task, limit, episodes: EPISODES, seed, rate_hz: task.rate_hz, max_steps: usize::MAX };
        let flight = fly(&policy, &plan)?;
        let verification = verify(exported.bytes.as_slice(), seed);
        Ok(SeedReport {
            training_seed: seed,
            image,
            image_bytes: exported.bytes.as_slice().len(),
            chip,
            golden_rows: booted.golden_rows,
            verified: verification.failures() == 0,
            train_seconds,
            agreement: exported.agreement,
            flight: flight.summary,
            latency: flight.latency,
        })
    }
}

fn flash_and_boot(image: &[u8], path: &Path) -> Result<firmware_sim::chip::Boot, Box<dyn std::error::Error>> {
    let mut chip = if path.exists() { Chip::read(path)? } else { Chip::blank() };
    chip.flash(image, None)?;
    chip.write(path)?;
    let mut chip = Chip::read(path)?;
    let boot = chip.boot()?;
    chip.confirm()?;
    chip.write(path)?;
    Ok(boot)
}

impl fmt::Display for SeedReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "seed {} trained in {:.0} s, exported, flashed, flown: reward {:.3}, cost {:.3}",
            self.training_seed, self.train_seconds, self.flight.reward_normalized, self.flight.cost_normalized
        )
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{TASK} at cost limit {}, {EPISODES} episodes a seed", self.data.cost_limit)?;
        writeln!(f, "reward and cost are normalised (Eq. 17); safe is a cost of at most 1\n")?;
        writeln!(f, "seed   reward     cost  in limit  agreement  golden  verified   p50 us   p99 us")?;
        for seed in &self.seeds {
            let flight = &seed.flight;
            writeln!(
                f,
                "{:>4} {:>8.3} {:>8.3} {:>6}/{:<2} {:>10.1e} {:>7} {:>9} {:>8.1} {:>8.1}",
                seed.training_seed,
                flight.reward_normalized,
                flight.cost_normalized,
                flight.safe_episodes,
                flight.episodes,
                seed.agreement.agreement_max_abs,
                seed.golden_rows,
                if seed.verified { "yes" } else { "NO" },
                flight.latency.latency_us_p50,
                flight.latency.latency_us_p99,
            )?;
        }
        writeln!(f, "\nsafe on {} of {} seeds, {:.0} s in all\n", self.safe_seeds, self.seeds.len(), self.seconds)?;
        writeln!(f, "host latency of an action\n{}\n", self.latency.to_string().trim_end())?;
        writeln!(f, "files in {}", self.out.display())?;
        writeln!(f, "  seed-N/policy.armor         the image: firmware-sim inspect, verify, bench")?;
        writeln!(f, "  seed-N/chip.bin             the flashed chip: firmware-sim run --chip")?;
        write!(f, "  seed-N                      the training run: armor-train report")
    }
}
