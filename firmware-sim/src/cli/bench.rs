//! `firmware-sim bench`

use std::fmt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use armor_core::image::{PolicyImage, Precision};
use armor_core::noise::Noise;
use armor_core::units::CostLimit;
use armor_infer::{Kernel, LoadError, Policy};
use serde::Serialize;

use super::boards;
use super::output::{CommandResult, Output};
use super::round_trip::{self, RoundTrips};
use super::{candidates, sampler_name};
use crate::host::{HostController, Pilot, pilot};
use crate::image_file::{ImageFile, NotAnImage};
use crate::latency::{Latency, Quantiles};

/// Rounds in which all rows take turns, so that a busy moment of this host falls on all of them.
const ROUNDS: u64 = 10;
/// Actions of a row in a round that are timed.
const ACTIONS: u64 = 100;
/// Actions before those, untimed, for caches and the processor's clock.
const WARM_UP: u64 = 10;

/// Measure what an action takes on this host, on every rung of the images and
/// every kernel of this processor.
#[derive(Debug, clap::Args)]
pub(super) struct Bench {
    /// The policy images.
    #[arg(required = true, value_name = "IMAGE")]
    images: Vec<PathBuf>,
    /// Measure the round trip of an action over the link as well, by TCP and by
    /// standard streams, on the longest rung of each image and on its shortest.
    #[arg(long)]
    link: bool,
    /// Take the best of so many candidates for an action, on the fastest kernel;
    /// several numbers stand side by side: 1,4,16. The images need a critic.
    #[arg(long, value_name = "K", value_delimiter = ',', value_parser = candidates)]
    best_of: Vec<u8>,
    /// What an action takes on a board, or on `all` of them, in place of this
    /// host: modelled, not measured.
    #[arg(long, value_name = "B", value_parser = boards::boards, conflicts_with_all = ["link", "best_of"])]
    board: Option<boards::Boards>,
}

#[derive(Serialize)]
struct Report {
    rungs: Vec<Row>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    link: Vec<RoundTrips>,
}

/// What one rung takes on one kernel.
#[derive(Serialize)]
struct Row {
    image: PathBuf,
    image_bytes: usize,
    precision: Precision,
    kernel: &'static str,
    candidates: u8,
    rung: usize,
    sampler: &'static str,
    steps: u16,
    macs_per_action: u64,
    actions: u64,
    #[serde(flatten)]
    quantiles: Quantiles,
    actions_per_second: f64,
    #[serde(skip)]
    durations: Vec<Duration>,
}

impl Bench {
    pub(super) fn run(self, output: Output) -> CommandResult {
        if let Some(boards) = &self.board {
            return boards::report(boards, &self.images, output);
        }
        let files = self.images.iter().map(|path| ImageFile::read(path)).collect::<Result<Vec<_>, _>>()?;
        let images = files.iter().map(ImageFile::image).collect::<Result<Vec<_>, NotAnImage>>()?;
        output.note(format_args!("timing {} actions of every rung on every kernel", ROUNDS * ACTIONS));
        let mut rows = Vec::new();
        for (path, image) in self.images.iter().zip(&images) {
            let rungs = 0..image.manifest().rungs.len();
            for kernel in Kernel::available().filter(|_| self.best_of.is_empty()) {
                rows.extend(rungs.clone().map(|rung| (image, Some(kernel), Row::new(path, image, (kernel, 1), rung))));
            }
            for rung in rungs {
                let row = |&candidates| (image, None, Row::new(path, image, (Kernel::best(), candidates), rung));
                rows.extend(self.best_of.iter().map(row));
            }
        }
        for round in 0..ROUNDS {
            for (image, kernel, row) in &mut rows {
                row.time(image, *kernel, round)?;
            }
        }
        let mut link = Vec::new();
        for (path, image) in self.images.iter().zip(&images).filter(|_| self.link) {
            let rungs = &image.manifest().rungs;
            for rung in rungs.first().into_iter().chain(rungs.last()) {
                link.extend(round_trip::time(path, rung.steps)?);
            }
        }
        output.report(&Report { rungs: rows.into_iter().map(|(.., row)| row.finish()).collect(), link })
    }
}

impl Row {
    fn new(path: &Path, image: &PolicyImage<'_>, (kernel, candidates): (Kernel, u8), rung: usize) -> Self {
        let manifest = image.manifest();
        let flown = manifest.rungs[rung];
        Self {
            image: path.into(),
            image_bytes: image.bytes().len(),
            precision: manifest.precision,
            kernel: kernel.name(),
            candidates,
            rung,
            sampler: sampler_name(flown.sampler),
            steps: flown.steps,
            macs_per_action: manifest.shape.macs_once() + u64::from(flown.steps) * manifest.shape.macs_per_step(),
            actions: 0,
            quantiles: Quantiles::default(),
            actions_per_second: 0.0,
            durations: Vec::new(),
        }
    }

    /// Times actions in states as the network was trained to see them, normal
    /// after normalisation; on a kernel, or as a pilot of candidates flies.
    fn time(&mut self, image: &PolicyImage<'_>, kernel: Option<Kernel>, round: u64) -> Result<(), LoadError> {
        let numbers = image.sections();
        let limit = CostLimit::from_cost(image.manifest().kappa.trained_max);
        let mut controller: Box<dyn Pilot> = match kernel {
            Some(kernel) => Box::new(HostController::new(Policy::load(image)?.with_kernel(kernel), limit, round)?),
            None => pilot(image, limit, round, self.candidates)?,
        };
        let mut state = vec![0.0; numbers.state_mean.len()];
        for tick in 0..WARM_UP + ACTIONS {
            Noise::new(round).fill_normal(0, tick, &mut state);
            for ((entry, mean), factor) in state.iter_mut().zip(numbers.state_mean).zip(numbers.state_factor) {
                *entry = mean + if *factor == 0.0 { 0.0 } else { *entry / factor };
            }
            let started = Instant::now();
            std::hint::black_box(controller.step_within(&state, 0.0, self.steps.into()));
            let duration = started.elapsed();
            if tick >= WARM_UP {
                self.durations.push(duration);
            }
        }
        Ok(())
    }

    fn finish(self) -> Self {
        let total: Duration = self.durations.iter().sum();
        let actions = self.durations.len() as u64;
        let latency: Latency = self.durations.iter().copied().collect();
        Self {
            actions,
            quantiles: latency.quantiles(),
            actions_per_second: actions as f64 / total.as_secs_f64(),
            ..self
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "precision  kernel       best of rung  chain    MAC/action  median us     p99 us")?;
        let mut image = None;
        for row in &self.rungs {
            if image != Some(&row.image) {
                write!(f, "\n{}, {} bytes", row.image.display(), row.image_bytes)?;
                image = Some(&row.image);
            }
            let (precision, chain) = (format!("{:?}", row.precision), format!("{} {}", row.sampler, row.steps));
            let Quantiles { latency_us_p50, latency_us_p99, .. } = row.quantiles;
            write!(
                f,
                "\n  {precision:<9}{:<13}{:>7}{:>5}  {chain:<8}{:>11}{latency_us_p50:>11.1}{latency_us_p99:>11.1}",
                row.kernel, row.candidates, row.rung, row.macs_per_action
            )?;
        }
        if !self.link.is_empty() {
            write!(f, "\n\nline   steps    median us      p99 us   from a state to its action, over the link")?;
        }
        for RoundTrips { line, steps, quantiles, .. } in &self.link {
            let Quantiles { latency_us_p50, latency_us_p99, .. } = quantiles;
            write!(f, "\n{line:<7}{steps:>5}{latency_us_p50:>13.1}{latency_us_p99:>12.1}")?;
        }
        Ok(())
    }
}
