//! `armor-train import`

use std::fmt;
use std::path::PathBuf;

use armor_core::image::PolicyImage;
use firmware_sim::cli::output::{CommandResult, Output};
use firmware_sim::file;
use serde::Serialize;

use crate::import::import;

/// Make an image of a policy that PyTorch trained.
///
/// Takes the denoisers of Diffusion-QL: a time embedding (time_mlp.1,
/// time_mlp.3) and an MLP of Mish layers over action, time and state
/// (mid_layer.0, .2, .4, final_layer), saved by safetensors.torch.save_file.
/// The TOML file gives task, steps and cost_limit_max, and, where they differ
/// from the usual: schedule (vp, cosine), prefix (of the tensors' names),
/// state_mean, state_std, action_low, action_high, action_fallback (lists).
#[derive(Debug, clap::Args)]
pub(super) struct Import {
    /// The tensors.
    tensors: PathBuf,
    /// What the tensors do not say.
    #[arg(long, value_name = "FILE.toml")]
    description: PathBuf,
    /// The image to write.
    #[arg(short, long, value_name = "IMAGE")]
    output: PathBuf,
}

#[derive(Serialize)]
struct Report {
    image: PathBuf,
    image_bytes: usize,
    task: String,
    state: u16,
    action: u16,
    hidden: u16,
    rungs: Vec<u16>,
    golden_rows: usize,
}

impl Import {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let tensors = file::read(&self.tensors)?;
        let description = String::from_utf8(file::read(&self.description)?)
            .map_err(|_| format!("{}: not a text file", self.description.display()))?;
        let bytes = import(&tensors, &description)
            .map_err(|error| format!("cannot import {}: {error}", self.tensors.display()))?;
        file::write(&self.output, bytes.as_slice())?;
        let image = PolicyImage::new_checked(bytes.as_slice())?;
        let manifest = image.manifest();
        output.report(&Report {
            image: self.output,
            image_bytes: bytes.as_slice().len(),
            task: manifest.task.into(),
            state: manifest.shape.state,
            action: manifest.shape.action,
            hidden: manifest.shape.hidden,
            rungs: manifest.rungs.iter().map(|rung| rung.steps).collect(),
            golden_rows: image.sections().golden.rows().len(),
        })
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { task, state, action, hidden, .. } = self;
        writeln!(f, "image               {}", self.image.display())?;
        writeln!(f, "size                {:>10} bytes", self.image_bytes)?;
        writeln!(f, "task                {task}, {state} state and {action} action entries")?;
        writeln!(f, "network             3 layers of {hidden}, chains of {:?} steps", self.rungs)?;
        write!(f, "golden trace        {} rows", self.golden_rows)
    }
}
