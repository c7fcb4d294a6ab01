//! `armor-train export`

use std::fmt;
use std::path::PathBuf;

use firmware_sim::cli::output::{CommandResult, Output};
use firmware_sim::file;
use serde::Serialize;

use super::run_folder::export_folder;
use crate::export::Agreement;

/// Write the policy of a run as an image for the controller.
#[derive(Debug, clap::Args)]
pub(super) struct Export {
    /// Folder of a run.
    dir: PathBuf,
    /// Number format of weights and activations.
    #[arg(long, default_value = "f32")]
    precision: Precision,
    /// The image to write.
    #[arg(short, long, value_name = "IMAGE")]
    output: PathBuf,
    /// The run's recorded data, if it was moved.
    #[arg(long)]
    data: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, Serialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
enum Precision {
    F32,
}

#[derive(Serialize)]
struct Report {
    image: PathBuf,
    precision: Precision,
    image_bytes: usize,
    steps: u64,
    #[serde(flatten)]
    agreement: Agreement,
}

impl Export {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let (checkpoint, exported) = export_folder(&self.dir, self.data.as_ref(), output)?;
        file::write(&self.output, exported.bytes.as_slice())?;
        output.report(&Report {
            image: self.output,
            precision: self.precision,
            image_bytes: exported.bytes.as_slice().len(),
            steps: checkpoint.state.step,
            agreement: exported.agreement,
        })
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "image               {}", self.image.display())?;
        writeln!(f, "size                {:>10} bytes", self.image_bytes)?;
        writeln!(f, "trained             {:>10} steps", self.steps)?;
        write!(
            f,
            "agreement           {:>10.1e} largest difference of an action, {} samples",
            self.agreement.agreement_max_abs, self.agreement.agreement_samples
        )
    }
}
