//! `firmware-sim bench`

use std::fmt;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use armor_core::image::PolicyImage;
use armor_core::noise::Noise;
use armor_core::units::CostLimit;
use armor_infer::{LoadError, Policy};
use serde::Serialize;

use super::output::{CommandResult, Output};
use super::round_trip::{self, RoundTrips};
use super::sampler_name;
use crate::host::HostController;
use crate::image_file::ImageFile;
use crate::latency::{Latency, Quantiles};

/// Actions that are timed.
const ACTIONS: u64 = 1000;
/// Actions before those, untimed, for caches and the processor's clock.
const WARM_UP: u64 = 50;

/// Measure what an action takes on this host, on every rung of the image.
#[derive(Debug, clap::Args)]
pub(super) struct Bench {
    /// The policy image.
    image: PathBuf,
    /// Measure the round trip of an action over the link as well, by TCP and by
    /// standard streams, on the longest rung and on the shortest.
    #[arg(long)]
    link: bool,
}

#[derive(Serialize)]
struct Report {
    task: String,
    image_bytes: usize,
    rungs: Vec<Row>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    link: Vec<RoundTrips>,
}

/// What one rung takes.
#[derive(Serialize)]
struct Row {
    rung: usize,
    sampler: &'static str,
    steps: u16,
    macs_per_action: u64,
    actions: u64,
    #[serde(flatten)]
    quantiles: Quantiles,
    actions_per_second: f64,
    #[serde(skip)]
    latency: Latency,
}

impl Bench {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let file = ImageFile::read(&self.image)?;
        let image = file.image()?;
        output.note(format_args!("timing {ACTIONS} actions of {}", self.image.display()));
        let manifest = image.manifest();
        let mut rungs = Vec::new();
        for (rung, flown) in manifest.rungs.iter().enumerate() {
            let durations = time(&image, flown.steps.into())?;
            let total: Duration = durations.iter().sum();
            let latency: Latency = durations.into_iter().collect();
            rungs.push(Row {
                rung,
                sampler: sampler_name(flown.sampler),
                steps: flown.steps,
                macs_per_action: manifest.shape.macs_once() + u64::from(flown.steps) * manifest.shape.macs_per_step(),
                actions: ACTIONS,
                quantiles: latency.quantiles(),
                actions_per_second: ACTIONS as f64 / total.as_secs_f64(),
                latency,
            });
        }
        let mut link = Vec::new();
        if self.link {
            let (longest, shortest) = (manifest.rungs.first(), manifest.rungs.last());
            for rung in longest.into_iter().chain(shortest) {
                link.extend(round_trip::time(&self.image, rung.steps)?);
            }
        }
        output.report(&Report { task: manifest.task.into(), image_bytes: image.bytes().len(), rungs, link })
    }
}

/// Times actions in states as the network was trained to see them, normal
/// after normalisation, by the longest rung of at most `steps` calls of the denoiser.
fn time(image: &PolicyImage<'_>, steps: usize) -> Result<Vec<Duration>, LoadError> {
    let numbers = image.sections();
    let limit = CostLimit::from_cost(image.manifest().kappa.trained_max);
    let mut controller = HostController::new(Policy::load(image)?, limit, 0)?;
    let mut state = vec![0.0; numbers.state_mean.len()];
    let mut durations = Vec::new();
    for tick in 0..WARM_UP + ACTIONS {
        Noise::new(0).fill_normal(0, tick, &mut state);
        for ((entry, mean), factor) in state.iter_mut().zip(numbers.state_mean).zip(numbers.state_factor) {
            *entry = mean + if *factor == 0.0 { 0.0 } else { *entry / factor };
        }
        let started = Instant::now();
        std::hint::black_box(controller.step_within(&state, 0.0, steps));
        let duration = started.elapsed();
        if tick >= WARM_UP {
            durations.push(duration);
        }
    }
    Ok(durations)
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}, {} bytes of image", self.task, self.image_bytes)?;
        writeln!(f, "rung  chain       MAC/action   median us      p99 us   actions/s")?;
        for row in &self.rungs {
            let chain = format!("{} {}", row.sampler, row.steps);
            let Quantiles { latency_us_p50, latency_us_p99, .. } = row.quantiles;
            writeln!(
                f,
                "{:>4}  {chain:<10}{:>12}{latency_us_p50:>12.1}{latency_us_p99:>12.1}{:>12.0}",
                row.rung, row.macs_per_action, row.actions_per_second
            )?;
        }
        if !self.link.is_empty() {
            writeln!(f, "\nline   steps    median us      p99 us   from a state to its action, over the link")?;
        }
        for RoundTrips { line, steps, quantiles, .. } in &self.link {
            let Quantiles { latency_us_p50, latency_us_p99, .. } = quantiles;
            writeln!(f, "{line:<7}{steps:>5}{latency_us_p50:>13.1}{latency_us_p99:>12.1}")?;
        }
        let Some(longest) = self.rungs.first() else { return Ok(()) };
        write!(f, "\nhost latency of an action on rung 0\n{}", longest.latency.to_string().trim_end())
    }
}
