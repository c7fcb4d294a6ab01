//! Policies of a size, untrained: what an action takes on a machine depends on
//! the shape and the precision of a policy, hardly on its weights.

use armor_core::image::{
    KappaRange, Layout, LevelScales, Manifest, PolicyImage, Precision, Provenance, Rung, SECTION_COUNT, SectionKind,
    write,
};
use armor_core::noise::Noise;
use armor_core::schedule::{Sampler, Schedule};
use armor_core::shape::Shape;
use armor_core::units::{Cost, CostLimit};
use armor_infer::Policy;

use crate::host::HostController;
use crate::memory::AlignedBytes;

/// Decides weights, states and noise.
const SEED: u64 = 1;
/// The only limit, in steps of a cost.
const LIMIT: Cost = Cost::from_raw(20 << 16);
/// States of the golden trace.
const GOLDEN_ROWS: u64 = 2;
/// The chains of a sized policy, longest first.
pub const RUNGS: [(Sampler, u16); 4] =
    [(Sampler::Ddpm, 20), (Sampler::Ddim, 10), (Sampler::Ddim, 5), (Sampler::Ddim, 1)];

/// The largest policy of the paper (Appendix B; 60 state entries, 2 of the
/// action, 20 steps), but for the width of its hidden layers.
pub const fn shape(hidden: u16) -> Shape {
    Shape { state: 60, action: 2, hidden, kappa_hidden: 32, kappa_embedding: 16, steps: 20 }
}

/// The image of a random policy; single precision has one layout, [`Layout::Rows`].
pub fn policy(shape: Shape, precision: Precision, layout: Layout) -> AlignedBytes {
    let schedule = Schedule::vp(shape.steps.into());
    let manifest = Manifest {
        task: "sized",
        release: 0,
        shape,
        precision,
        layout,
        kappa: KappaRange { scale: 0.05, trained_max: LIMIT },
        schedule,
        rungs: RUNGS.map(|(sampler, steps)| Rung { sampler, steps }).into_iter().collect(),
        provenance: Provenance {
            version: env!("CARGO_PKG_VERSION"),
            preset: "none",
            seed: SEED,
            steps: 0,
            data_sha256: [0; 32],
            config_sha256: [0; 32],
        },
        agreement_max_abs: 0.0,
        quality: Default::default(),
        sections: Default::default(),
    };
    let contents = |trace: &[u32]| {
        SectionKind::ALL.map(|kind| match kind {
            SectionKind::Golden => trace.to_vec(),
            kind => section(&manifest, kind),
        })
    };
    // A trace without rows, to have an image that the controller can fly.
    let draft = build(&manifest, &contents(&[0; 4]));
    let image = PolicyImage::new_checked(draft.as_slice()).expect("the sections have the lengths of the shape");
    let trace = golden(Policy::load(&image).expect("this host has all number formats"));
    build(&manifest, &contents(&trace))
}

fn build(manifest: &Manifest<'_>, contents: &[Vec<u32>; SECTION_COUNT]) -> AlignedBytes {
    let room = 4096 + contents.iter().map(|words| 4 * words.len() + 16).sum::<usize>();
    let mut bytes = AlignedBytes::filled(0, room);
    let contents: [&[u32]; SECTION_COUNT] = contents.each_ref().map(Vec::as_slice);
    let length = write(manifest, &contents, bytes.as_mut_slice()).expect("a sized policy is a valid one");
    AlignedBytes::from(&bytes.as_slice()[..length])
}

/// A few states at the full budget, and what the controller does in them.
fn golden(policy: Policy<'_>) -> Vec<u32> {
    let mut controller =
        HostController::new(policy, CostLimit::from_cost(LIMIT), SEED).expect("the limit is the policy's own");
    let mut words = vec![SEED as u32, 0, LIMIT.to_raw(), GOLDEN_ROWS as u32];
    for row in 0..GOLDEN_ROWS {
        let mut state = vec![0.0; policy.shape().state.into()];
        Noise::new(SEED).fill_normal(0, row, &mut state);
        let step = controller.step(&state, 0.0);
        words.extend(state.iter().map(|value| value.to_bits()));
        words.extend([0f32.to_bits(), step.kappa.to_raw()]);
        words.extend(step.action.iter().take(policy.shape().action.into()).map(|value| value.to_bits()));
    }
    words
}

/// The words of a section but the golden trace.
fn section(manifest: &Manifest<'_>, kind: SectionKind) -> Vec<u32> {
    let shape = &manifest.shape;
    let [s, a, h, k, e, n] =
        [shape.state, shape.action, shape.hidden, shape.kappa_hidden, shape.kappa_embedding, shape.steps]
            .map(usize::from);
    // Weights of the usual size, in single precision.
    let layer = |inputs: usize, words: usize| {
        let mut values = vec![0.0; words];
        Noise::new(SEED).fill_normal(1 + kind as u32, 0, &mut values);
        values.iter().map(|value| (value / (inputs as f32).sqrt()).to_bits()).collect::<Vec<u32>>()
    };
    let bound = |value: f32| vec![value.to_bits(); a];
    match kind {
        SectionKind::StateNormaliser => [vec![0; s], vec![1f32.to_bits(); s]].concat(),
        SectionKind::ActionBounds => [bound(-1.0), bound(1.0), bound(0.0)].concat(),
        SectionKind::Kappa1 => layer(1, 2 * k),
        SectionKind::Kappa2 => layer(k, (k + 1) * k),
        SectionKind::Kappa3 => layer(k, (k + 1) * e),
        SectionKind::Chain => {
            let chain = |&(sampler, steps): &(Sampler, u16)| manifest.schedule.chain(sampler, steps.into());
            RUNGS.iter().flat_map(chain).flat_map(|step| step.to_f32().to_words()).collect()
        }
        SectionKind::Golden | SectionKind::BudgetMap => Vec::new(),
        kind => match manifest.precision.code_bits() {
            Some(bits) => integers(manifest, kind, bits),
            None => match kind {
                SectionKind::Context => layer(s + e, (s + e + 1) * h),
                SectionKind::TimeTable => layer(1, n * h),
                SectionKind::ActionInput => layer(a, a * h),
                SectionKind::Hidden2 | SectionKind::Hidden3 => layer(h, (h + 1) * h),
                SectionKind::Output => layer(h, (h + 1) * a),
                _ => Vec::new(),
            },
        },
    }
}

/// A section of an integer policy: random codes, and scales by which the
/// activations use a good part of theirs.
fn integers(manifest: &Manifest<'_>, kind: SectionKind, bits: u32) -> Vec<u32> {
    let shape = &manifest.shape;
    let [s, a, h, e, n] =
        [shape.state, shape.action, shape.hidden, shape.kappa_embedding, shape.steps].map(usize::from);
    let random = |bytes: usize| -> Vec<u32> {
        (0..bytes.div_ceil(4) as u64).map(|at| Noise::new(SEED).words(1 + kind as u32, at, 0)[0]).collect()
    };
    let rows = |columns: usize| [random(manifest.layout.bytes(h, columns)), vec![1 << 30; h]].concat();
    let bias: Vec<u32> = (0..h as u32).map(|output| (output % 7 * 500).wrapping_sub(1500)).collect();
    let root = |width: usize| (width as f32).sqrt();
    match kind {
        SectionKind::Context => [rows(s), rows(e), bias].concat(),
        SectionKind::TimeTable => random(2 * n * h).iter().map(|word| word & 0x07FF_07FF).collect(),
        SectionKind::ActionInput => random(2 * a * h),
        SectionKind::Hidden2 | SectionKind::Hidden3 => [rows(h), bias].concat(),
        SectionKind::Output => {
            let factor = 1.0 / 16256.0 / root(h);
            [random(manifest.layout.bytes(2 * a, h)), vec![factor.to_bits(); a], vec![0; a]].concat()
        }
        SectionKind::Scales => {
            let unit = |width: usize| (2f32.powi(25) / root(width)).to_bits();
            let activate = |bits: u32| (512.0 * ((1u32 << bits) - 1) as f32 / 4.0) as i32;
            let level = LevelScales {
                activate: [activate(bits), activate(bits), activate(15)],
                rescale: [(2f32.powi(26) / root(h)) as i32; 2],
                last_scale: 4.0 / 32767.0,
            };
            let header = [unit(s), unit(e), 4000f32.to_bits(), 0, 16];
            [header.to_vec(), level.to_words().repeat(n)].concat()
        }
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::verify;

    #[test]
    fn every_precision_makes_a_policy_that_passes_all_checks() {
        let small = Shape { state: 5, hidden: 24, ..shape(24) };
        for (precision, layout) in [
            (Precision::F32, Layout::Rows),
            (Precision::Int16x8, Layout::Rows),
            (Precision::Int8, Layout::Rows),
            (Precision::Int8, Layout::Paired),
        ] {
            let verification = verify(policy(small, precision, layout).as_slice(), 1);
            assert!(verification.passed, "{verification}");
        }
    }
}
