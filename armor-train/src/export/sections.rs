//! The words of an image's sections, from the trainer's parameters.
//!
//! The trainer keeps a layer's weights `outputs x inputs`, column by column,
//! which is the image's order, input by input.

use armor_core::image::{Rung, SECTION_COUNT, SectionKind};

use crate::actor::Process;
use crate::actor::denoiser::Denoiser;
use crate::nn::Linear;
use crate::normaliser::Normaliser;

/// The sections of a policy in the order of [`SectionKind::ALL`]; the golden trace is `golden`,
/// the knots of a budget map `map`, empty where there is none.
pub(crate) fn sections(
    (denoiser, process, parameters): (&Denoiser, &Process, &[f32]),
    normaliser: &Normaliser,
    rungs: &[Rung],
    [golden, map]: [&[u32]; 2],
) -> [Vec<u32>; SECTION_COUNT] {
    let widths = denoiser.widths();
    let first = denoiser.first();
    let [of_action, of_state, of_kappa, _] = denoiser.blocks();
    let kappa = denoiser.kappa().layers();
    let body = denoiser.body().layers();
    let layer = |layer: &Linear| words(&parameters[layer.offset..layer.end()]);
    let block = |inputs: std::ops::Range<usize>| {
        words(&parameters[first.offset + inputs.start * first.outputs..first.offset + inputs.end * first.outputs])
    };
    SectionKind::ALL.map(|kind| match kind {
        SectionKind::StateNormaliser => [words(&normaliser.mean), words(&normaliser.factor)].concat(),
        SectionKind::ActionBounds => words(&[-1.0f32, 1.0, 0.0].map(|bound| vec![bound; widths.action]).concat()),
        SectionKind::Kappa1 => layer(&kappa[0]),
        SectionKind::Kappa2 => layer(&kappa[1]),
        SectionKind::Kappa3 => layer(&kappa[2]),
        SectionKind::Context => {
            [block(of_state.clone()), block(of_kappa.clone()), words(first.bias(parameters))].concat()
        }
        SectionKind::TimeTable => words(denoiser.time_table(parameters).as_slice()),
        SectionKind::ActionInput => block(of_action.clone()),
        SectionKind::Hidden2 => layer(&body[0]),
        SectionKind::Hidden3 => layer(&body[1]),
        SectionKind::Output => layer(&body[2]),
        SectionKind::Scales => Vec::new(),
        SectionKind::Chain => {
            let chain = |rung: &Rung| process.chain(rung.sampler, rung.steps.into());
            rungs.iter().flat_map(chain).flat_map(|step| step.to_f32().to_words()).collect()
        }
        SectionKind::Golden => golden.to_vec(),
        SectionKind::BudgetMap => map.to_vec(),
        SectionKind::Critic => Vec::new(),
    })
}

fn words(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}
