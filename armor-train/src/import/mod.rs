//! Policies that were trained elsewhere, as images: the MLP denoisers of
//! Diffusion-QL and its kin, saved by PyTorch as safetensors.
//!
//! ```text
//! time_mlp     code(n - 1) -> Linear, Mish, Linear           sines, then cosines
//! mid_layer    [a; time; s] -> 3 x (Linear, Mish)
//! final_layer  -> Linear = eps
//! ```
//!
//! A TOML file says what the tensors do not: task, noise schedule, bounds, how
//! states are normalised ([`Description`]). Such a policy does not see the
//! budget: its image has a kappa embedding of one zero, and the controller
//! keeps the budget without the policy knowing.

mod description;
mod tensors;

use armor_core::image::{
    KappaRange, Layout, Manifest, PolicyImage, Precision, Provenance, SECTION_COUNT, SectionKind, WriteError,
};
use armor_core::noise::Noise;
use armor_core::schedule::Schedule;
use armor_core::shape::Shape;
use armor_core::units::{CostLimit, LimitError};
use armor_infer::Policy;
use sha2::{Digest, Sha256};

use crate::actor::Process;
use crate::actor::denoiser::{Denoiser, Widths};
use crate::export::{self, ExportError, ImageBytes};
use crate::normaliser::Normaliser;

pub use description::{Description, DescriptionError};
pub use tensors::{TensorError, Tensors};

/// Steps of the golden trace.
const ROWS: usize = 32;
/// Stream of the states that the golden trace is flown from.
const STATES: u32 = u32::MAX - 1;

/// Why a policy cannot be imported.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The description is wrong.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// The tensors are wrong.
    #[error(transparent)]
    Tensor(#[from] TensorError),
    /// The largest cost limit is none.
    #[error("cost_limit_max: {0}")]
    Limit(#[from] LimitError),
    /// The policy makes no image, or does not fly.
    #[error(transparent)]
    Export(#[from] ExportError),
}

/// The image of a policy: `tensors` in safetensors, `description` in TOML.
///
/// # Errors
/// [`ImportError`]
pub fn import(tensors: &[u8], description: &str) -> Result<ImageBytes, ImportError> {
    let given = Description::parse(description)?;
    let tensors = Tensors::read(tensors, &given.prefix)?;
    let widths = tensors.widths(&given)?;
    // What the network does not have: an embedding of the budget.
    let denoiser = Denoiser::new(Widths { kappa_hidden: 1, kappa_embedding: 1, ..widths }, 0.0);
    let parameters = tensors.parameters(&denoiser)?;
    let process = Process::paper(Schedule { noising: given.schedule, steps: given.steps });
    let limit = CostLimit::new(given.cost_limit_max)?;

    let mut hash = Sha256::new();
    hash.update(description);
    let manifest = Manifest {
        task: &given.task,
        release: 0,
        shape: Shape {
            state: widths.state as u16,
            action: widths.action as u16,
            hidden: widths.hidden as u16,
            kappa_hidden: 1,
            kappa_embedding: 1,
            steps: given.steps as u16,
        },
        precision: Precision::F32,
        layout: Layout::Rows,
        kappa: KappaRange { scale: 1.0, trained_max: limit.cost() },
        schedule: process.schedule,
        rungs: export::ladder(given.steps as u16),
        provenance: Provenance {
            version: env!("CARGO_PKG_VERSION"),
            preset: "import",
            seed: 0,
            steps: 0,
            data_sha256: tensors.sha256(),
            config_sha256: hash.finalize().into(),
        },
        agreement_max_abs: 0.0,
        quality: Default::default(),
        sections: Default::default(),
    };

    let normaliser = given.normaliser(widths.state)?;
    let bounds = given.bounds(widths.action)?;
    let contents = |trace: &[u32]| -> [Vec<u32>; SECTION_COUNT] {
        let network = (&denoiser, &process, parameters.as_slice());
        let mut sections = export::sections(network, &normaliser, &manifest.rungs, [trace, &[]]);
        sections[SectionKind::ActionBounds as usize] = bounds.iter().map(|bound| bound.to_bits()).collect();
        sections
    };
    let draft = export::build(&manifest, &contents(&[0; 4]))?;
    let image =
        PolicyImage::new_checked(draft.as_slice()).map_err(|error| ExportError::Write(WriteError::Invalid(error)))?;
    let trace = golden(&image, &normaliser, limit)?;
    let quality = export::quality(&image, limit, 0)?;
    Ok(export::build(&Manifest { quality, ..manifest.clone() }, &contents(&trace))?)
}

/// A golden trace over states drawn as the normaliser says they are spread, with
/// a cost at every fourth step.
fn golden(image: &PolicyImage<'_>, normaliser: &Normaliser, limit: CostLimit) -> Result<Vec<u32>, ExportError> {
    let states = (0..ROWS as u64).map(|row| {
        let mut state = vec![0.0; normaliser.mean.len()];
        Noise::new(0).fill_normal(STATES, row, &mut state);
        for (entry, (mean, factor)) in state.iter_mut().zip(normaliser.mean.iter().zip(&normaliser.factor)) {
            *entry = mean + *entry / factor;
        }
        state
    });
    let costs = (0..ROWS).map(|row| f32::from(u8::from(row % 4 == 3)));
    export::fly_golden(Policy::load(image)?, limit, 0, states.zip(costs))
}
