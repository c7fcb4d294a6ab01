//! `armor-train export`

use std::fmt;
use std::path::PathBuf;

use armor_core::image::{self, PolicyImage};
use firmware_sim::cli::output::{CommandResult, Output};
use firmware_sim::file;
use serde::Serialize;

use super::misuse;
use super::run_folder::export_folder;
use crate::export::{Agreement, released, with_critic};
use crate::onnx::onnx;
use crate::quantize::{COST_BOUND, Drift, REWARD_BOUND, quantize};

/// Write the policy of a run as an image for the controller.
///
/// A policy in integers is first compared with the one in single precision: on
/// recorded states, and in flight where the task has a native plant.
#[derive(Debug, clap::Args)]
pub(super) struct Export {
    /// Folder of a run.
    dir: PathBuf,
    /// Number format of weights and activations.
    #[arg(long, default_value = "f32")]
    precision: Precision,
    /// Order of the weights of an integer image: in pairs for a Cortex-M4, M7
    /// or M33, in rows for all others. Every machine flies both, to the same bits.
    #[arg(long, default_value = "rows")]
    layout: Layout,
    /// The image to write.
    #[arg(short, long, value_name = "IMAGE")]
    output: PathBuf,
    /// Release number: a robot's chip refuses one below that of its confirmed policy.
    #[arg(long, value_name = "N", default_value_t = 0)]
    release: u32,
    /// Put the run's critic into the image, for controllers that take the best
    /// of several actions by it.
    #[arg(long)]
    critic: bool,
    /// Write one denoising step as a graph for other runtimes, too.
    #[arg(long, value_name = "FILE")]
    onnx: Option<PathBuf>,
    /// The run's recorded data, if it was moved.
    #[arg(long)]
    data: Option<PathBuf>,
    /// Write the image even if integers change how the policy flies.
    #[arg(long)]
    accept_drift: bool,
}

#[derive(Clone, Copy, Debug, Serialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
enum Precision {
    F32,
    Int16x8,
    Int8,
}

impl From<Precision> for image::Precision {
    fn from(precision: Precision) -> Self {
        match precision {
            Precision::F32 => Self::F32,
            Precision::Int16x8 => Self::Int16x8,
            Precision::Int8 => Self::Int8,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Layout {
    Rows,
    Paired,
}

impl From<Layout> for image::Layout {
    fn from(layout: Layout) -> Self {
        match layout {
            Layout::Rows => Self::Rows,
            Layout::Paired => Self::Paired,
        }
    }
}

#[derive(Serialize)]
struct Report {
    image: PathBuf,
    onnx: Option<PathBuf>,
    release: u32,
    precision: Precision,
    image_bytes: usize,
    steps: u64,
    #[serde(flatten)]
    agreement: Agreement,
    drift: Drift,
}

impl Export {
    pub(super) fn run(self, output: Output) -> CommandResult {
        if matches!((self.precision, self.layout), (Precision::F32, Layout::Paired)) {
            misuse(&"weights in f32 have one layout; leave out --layout, or choose --precision int8 or int16x8");
        }
        let (checkpoint, data, exported) = export_folder(&self.dir, self.data.as_ref(), output)?;
        let graph = match &self.onnx {
            Some(_) => onnx(&PolicyImage::new_checked(exported.bytes.as_slice())?)?,
            None => Vec::new(),
        };
        let (bytes, agreement, drift) = match self.precision {
            Precision::F32 => (exported.bytes, exported.agreement, Drift::default()),
            precision => {
                let float = PolicyImage::new_checked(exported.bytes.as_slice())?;
                let quantized = quantize(&float, &data, precision.into(), self.layout.into())?;
                (quantized.bytes, quantized.agreement, quantized.drift)
            }
        };
        let bytes = match self.critic {
            true => with_critic(&PolicyImage::new_checked(bytes.as_slice())?, &checkpoint)?,
            false => bytes,
        };
        let bytes = released(&PolicyImage::new_checked(bytes.as_slice())?, self.release)?;
        let report = Report {
            image: self.output,
            onnx: self.onnx,
            release: self.release,
            precision: self.precision,
            image_bytes: bytes.as_slice().len(),
            steps: checkpoint.state.step,
            agreement,
            drift,
        };
        if let Some(rung) = report.drift.beyond_bounds().filter(|_| !self.accept_drift) {
            output.note(&report);
            return Err(format!(
                "refused to write {}: in {:?}, {rung}; reward may move by {REWARD_BOUND} and cost rise by {COST_BOUND}; \
                 export as int16x8 or f32, or take it with --accept-drift",
                report.image.display(),
                report.precision,
            )
            .into());
        }
        file::write(&report.image, bytes.as_slice())?;
        if let Some(path) = &report.onnx {
            file::write(path, &graph)?;
        }
        output.report(&report)
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "image               {}", self.image.display())?;
        if let Some(path) = &self.onnx {
            writeln!(f, "graph               {}", path.display())?;
        }
        writeln!(f, "size                {:>10} bytes", self.image_bytes)?;
        writeln!(f, "trained             {:>10} steps", self.steps)?;
        let Agreement { agreement_max_abs, agreement_rms, agreement_samples } = self.agreement;
        let other = if matches!(self.precision, Precision::F32) { "trainer" } else { "f32" };
        writeln!(f, "actions against {other}, {agreement_samples} recorded states")?;
        write!(f, "  largest difference{agreement_max_abs:>10.1e}, root mean square {agreement_rms:.1e}")?;
        for rung in &self.drift.0 {
            write!(f, "\n{rung}")?;
        }
        Ok(())
    }
}
