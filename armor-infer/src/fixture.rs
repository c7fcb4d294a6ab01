//! Policy images with random weights, for tests.

use armor_core::image::{
    KappaRange, Layout, LevelScales, Manifest, PolicyImage, Precision, Provenance, Rung, SECTION_ALIGNMENT,
    SECTION_COUNT, SectionKind, write,
};
use armor_core::noise::Noise;
use armor_core::schedule::{Sampler, Schedule};
use armor_core::shape::Shape;
use armor_core::units::{Cost, CostLimit};
use std::vec;
use std::vec::Vec;

use crate::{Controller, Policy};

/// The paper's network on `ball-run`.
pub(crate) const PAPER: Shape =
    Shape { state: 7, action: 2, hidden: 256, kappa_hidden: 32, kappa_embedding: 16, steps: 20 };
/// A network that an exhaustive test can afford.
pub(crate) const SMALL: Shape = Shape { state: 3, action: 2, hidden: 8, kappa_hidden: 4, kappa_embedding: 3, steps: 5 };
/// The largest cost limit of every fixture.
pub(crate) const TRAINED_MAX: f32 = 40.0;

/// The bytes of an image.
pub(crate) struct Fixture {
    memory: Vec<u8>,
    start: usize,
}

/// An image that may still be changed.
#[derive(Clone)]
pub(crate) struct Parts {
    pub(crate) manifest: Manifest<'static>,
    contents: Vec<Vec<u32>>,
}

impl Fixture {
    /// A policy with random weights of the usual size, actions within -1 and 1,
    /// fallback 0, and one full DDPM chain.
    pub(crate) fn random(shape: Shape, seed: u64) -> Parts {
        let manifest = Manifest {
            task: "fixture",
            release: 0,
            shape,
            precision: Precision::F32,
            layout: Layout::Rows,
            kappa: KappaRange { scale: 0.05, trained_max: Cost::from_incurred(TRAINED_MAX).unwrap() },
            schedule: Schedule::vp(shape.steps.into()),
            rungs: Default::default(),
            provenance: Provenance {
                version: "0.0.0",
                preset: "none",
                seed,
                steps: 0,
                data_sha256: [0; 32],
                config_sha256: [0; 32],
            },
            agreement_max_abs: 0.0,
            quality: Default::default(),
            sections: Default::default(),
        };
        let [s, a, h, k, e, n] =
            [shape.state, shape.action, shape.hidden, shape.kappa_hidden, shape.kappa_embedding, shape.steps]
                .map(usize::from);
        let layer = |kind: SectionKind, inputs: usize, words: usize| {
            let mut values = vec![0.0; words];
            Noise::new(seed).fill_normal(kind as u32, 0, &mut values);
            values.iter().map(|value| (value / (inputs as f32).sqrt()).to_bits()).collect::<Vec<u32>>()
        };
        let normaliser = |_| [vec![0.25f32.to_bits(); s], vec![0.5f32.to_bits(); s]].concat();
        let contents = SectionKind::ALL.map(|kind| match kind {
            SectionKind::StateNormaliser => normaliser(kind),
            SectionKind::ActionBounds | SectionKind::Chain | SectionKind::Scales => Vec::new(),
            SectionKind::Kappa1 => layer(kind, 1, 2 * k),
            SectionKind::Kappa2 => layer(kind, k, k * k + k),
            SectionKind::Kappa3 => layer(kind, k, k * e + e),
            SectionKind::Context => layer(kind, s + e, (s + e) * h + h),
            SectionKind::TimeTable => layer(kind, 1, n * h),
            SectionKind::ActionInput => layer(kind, a, a * h),
            SectionKind::Hidden2 | SectionKind::Hidden3 => layer(kind, h, h * h + h),
            SectionKind::Output => layer(kind, h, h * a + a),
            SectionKind::Golden => vec![0; 4],
            SectionKind::BudgetMap | SectionKind::Critic => Vec::new(),
        });
        let mut parts = Parts { manifest, contents: contents.into() };
        parts.set_bounds(-1.0, 1.0);
        parts.set_rungs(&[(Sampler::Ddpm, shape.steps)]);
        parts
    }

    /// The same in integers, with random codes for weights; scales are such that
    /// the activations use a good part of their codes.
    pub(crate) fn integers(shape: Shape, precision: Precision, seed: u64) -> Parts {
        let mut parts = Self::random(shape, seed);
        let bits = precision.code_bits().unwrap();
        parts.manifest.precision = precision;
        let [s, a, h, e, n] =
            [shape.state, shape.action, shape.hidden, shape.kappa_embedding, shape.steps].map(usize::from);
        let random = |kind: SectionKind, bytes: usize| {
            let word = |i| Noise::new(seed).words(100 + kind as u32, i, 0)[0];
            (0..bytes.div_ceil(4) as u64).map(word).collect::<Vec<u32>>()
        };
        let multiplier = vec![1 << 30; h];
        let bias: Vec<u32> = (0..h as u32).map(|o| (o % 7 * 500).wrapping_sub(1500)).collect();
        let rows = |kind, inputs: usize| [random(kind, h * inputs), multiplier.clone()].concat();
        let hidden = |kind| [rows(kind, h), bias.clone()].concat();
        let root = |width: usize| (width as f32).sqrt();
        let unit = |width: usize| (2f32.powi(25) / root(width)).to_bits();
        let range = 4.0 / ((1u32 << bits) - 1) as f32;
        let level = LevelScales {
            activate: [(512.0 / range) as i32, (512.0 / range) as i32, (512.0 * 32767.0 / 4.0) as i32],
            rescale: [(2f32.powi(26) / root(h)) as i32; 2],
            last_scale: 4.0 / 32767.0,
        };
        let output = [random(SectionKind::Output, 2 * a * h), vec![(1.0 / 16256.0 / root(h)).to_bits(); a], vec![0; a]];
        let header = [unit(s), unit(e), 4000f32.to_bits(), 0, 16];
        for (kind, words) in [
            (
                SectionKind::Context,
                [rows(SectionKind::Context, s), rows(SectionKind::Kappa3, e), bias.clone()].concat(),
            ),
            (
                SectionKind::TimeTable,
                random(SectionKind::TimeTable, 2 * n * h).iter().map(|w| w & 0x07FF_07FF).collect(),
            ),
            (SectionKind::ActionInput, random(SectionKind::ActionInput, 2 * a * h)),
            (SectionKind::Hidden2, hidden(SectionKind::Hidden2)),
            (SectionKind::Hidden3, hidden(SectionKind::Hidden3)),
            (SectionKind::Output, output.concat()),
            (SectionKind::Scales, [&header[..], &level.to_words().repeat(n)].concat()),
        ] {
            *parts.section(kind) = words;
        }
        parts
    }

    /// The image, read in place.
    pub(crate) fn image(&self) -> PolicyImage<'_> {
        PolicyImage::new_checked(&self.memory[self.start..]).unwrap()
    }
}

impl Parts {
    /// The same integers, the weights of two rows in pairs.
    pub(crate) fn paired(mut self) -> Parts {
        self.manifest.layout = Layout::Paired;
        let shape = self.manifest.shape;
        let [s, a, h, e] = [shape.state, shape.action, shape.hidden, shape.kappa_embedding].map(usize::from);
        for (kind, matrices) in [
            (SectionKind::Context, &[(h, s), (h, e)][..]),
            (SectionKind::Hidden2, &[(h, h)]),
            (SectionKind::Hidden3, &[(h, h)]),
            (SectionKind::Output, &[(2 * a, h)]),
        ] {
            let words = self.section(kind);
            let mut rest = std::mem::take(words);
            for &(rows, columns) in matrices {
                let others = rest.split_off((rows * columns).div_ceil(4));
                let bytes: &[i8] = bytemuck::cast_slice(&rest);
                let mut arranged = vec![0u32; Layout::Paired.bytes(rows, columns) / 4];
                Layout::Paired.arrange(&bytes[..rows * columns], columns, bytemuck::cast_slice_mut(&mut arranged));
                words.extend(arranged);
                // After each matrix of layer 1 come its multipliers.
                let multipliers = if kind == SectionKind::Context { h } else { 0 };
                words.extend(&others[..multipliers]);
                rest = others[multipliers..].to_vec();
            }
            words.extend(rest);
        }
        self
    }

    /// The words of a section.
    pub(crate) fn section(&mut self, kind: SectionKind) -> &mut Vec<u32> {
        &mut self.contents[kind as usize]
    }

    /// Every action entry lies within `low` and `high`; the fallback is their middle.
    pub(crate) fn set_bounds(&mut self, low: f32, high: f32) {
        let a = usize::from(self.manifest.shape.action);
        *self.section(SectionKind::ActionBounds) =
            [low, high, 0.5 * (low + high)].map(|value| vec![value.to_bits(); a]).concat();
    }

    /// The chains of the image.
    pub(crate) fn set_rungs(&mut self, rungs: &[(Sampler, u16)]) {
        let schedule = self.manifest.schedule;
        self.manifest.rungs = rungs.iter().map(|&(sampler, steps)| Rung { sampler, steps }).collect();
        *self.section(SectionKind::Chain) = rungs
            .iter()
            .flat_map(|&(sampler, steps)| {
                schedule.chain(sampler, steps.into()).flat_map(|step| step.to_f32().to_words())
            })
            .collect();
    }

    /// Flies an episode and keeps it as the golden trace.
    pub(crate) fn record_golden<const S: usize>(
        &mut self,
        limit: CostLimit,
        seed: u64,
        states: &[[f32; S]],
        costs: &[f32],
    ) {
        let fixture = self.clone().build();
        let policy = Policy::load(&fixture.image()).unwrap();
        let mut controller = Controller::<16, 8, 256>::new(policy, limit, seed).unwrap();
        let mut words = vec![seed as u32, (seed >> 32) as u32, limit.cost().to_raw(), states.len() as u32];
        for (state, cost) in states.iter().zip(costs) {
            let step = controller.step(state, *cost);
            words.extend(state.iter().chain([cost]).map(|value| value.to_bits()));
            words.push(step.kappa.to_raw());
            words.extend(step.action.iter().take(policy.shape().action.into()).map(|value| value.to_bits()));
        }
        *self.section(SectionKind::Golden) = words;
    }

    /// Writes the image.
    pub(crate) fn build(self) -> Fixture {
        let contents: [&[u32]; SECTION_COUNT] = core::array::from_fn(|i| self.contents[i].as_slice());
        let words: usize = contents.iter().map(|words| words.len()).sum();
        // Room for header, manifest and the padding of every section.
        let mut memory = vec![0; 4 * words + 4096];
        let start = memory.as_ptr().align_offset(SECTION_ALIGNMENT);
        write(&self.manifest, &contents, &mut memory[start..]).unwrap();
        Fixture { memory, start }
    }
}
