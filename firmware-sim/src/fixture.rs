//! Policy images with random weights, for this crate's tests and its command-line tests.

use armor_core::image::{
    KappaRange, Layout, Manifest, Precision, Provenance, Quality, Rung, SECTION_COUNT, SectionKind, write,
};
use armor_core::noise::Noise;
use armor_core::schedule::{Sampler, Schedule};
use armor_core::shape::Shape;
use armor_core::units::{Cost, CostLimit};
use armor_infer::{Controller, Policy};

/// A small network for `ball-run`.
pub(crate) const BALL_RUN: Shape =
    Shape { state: 7, action: 2, hidden: 16, kappa_hidden: 4, kappa_embedding: 3, steps: 5 };
/// The largest cost limit of a fixture.
pub(crate) const TRAINED_MAX: f32 = 40.0;
/// Rows of a fixture's golden trace.
pub(crate) const GOLDEN_ROWS: usize = 6;

/// What an image is made of.
#[derive(Clone)]
pub(crate) struct Parts {
    pub(crate) manifest: Manifest<'static>,
    pub(crate) sections: Vec<Vec<u32>>,
}

/// A `ball-run` image: its bytes, for an aligned place.
pub(crate) fn ball_run(seed: u64) -> Vec<u8> {
    Parts::random("ball-run", BALL_RUN, seed).with_golden().bytes()
}

impl Parts {
    /// Random weights of the usual size, actions within -1 and 1, one DDPM and
    /// one shorter DDIM chain, and no golden trace yet.
    pub(crate) fn random(task: &'static str, shape: Shape, seed: u64) -> Self {
        let schedule = Schedule::vp(shape.steps.into());
        let rungs = [(Sampler::Ddpm, shape.steps), (Sampler::Ddim, 2)].map(|(sampler, steps)| Rung { sampler, steps });
        let chain = rungs.iter().flat_map(|rung| schedule.chain(rung.sampler, rung.steps.into()));
        let chain: Vec<u32> = chain.flat_map(|step| step.to_f32().to_words()).collect();
        let [s, a, h, k, e, n] =
            [shape.state, shape.action, shape.hidden, shape.kappa_hidden, shape.kappa_embedding, shape.steps]
                .map(usize::from);
        let layer = |kind: SectionKind, inputs: usize, words: usize| {
            let mut values = vec![0.0; words];
            Noise::new(seed).fill_normal(kind as u32, 0, &mut values);
            values.iter().map(|value| (value / (inputs as f32).sqrt()).to_bits()).collect::<Vec<u32>>()
        };
        let sections = SectionKind::ALL.map(|kind| match kind {
            SectionKind::StateNormaliser => [vec![0.25f32.to_bits(); s], vec![0.5f32.to_bits(); s]].concat(),
            SectionKind::ActionBounds => [-1.0f32, 1.0, 0.0].map(|bound| vec![bound.to_bits(); a]).concat(),
            SectionKind::Kappa1 => layer(kind, 1, 2 * k),
            SectionKind::Kappa2 => layer(kind, k, k * k + k),
            SectionKind::Kappa3 => layer(kind, k, k * e + e),
            SectionKind::Context => layer(kind, s + e, (s + e) * h + h),
            SectionKind::TimeTable => layer(kind, 1, n * h),
            SectionKind::ActionInput => layer(kind, a, a * h),
            SectionKind::Hidden2 | SectionKind::Hidden3 => layer(kind, h, h * h + h),
            SectionKind::Output => layer(kind, h, h * a + a),
            SectionKind::Scales => Vec::new(),
            SectionKind::Chain => chain.clone(),
            SectionKind::Golden => vec![0; 4],
            SectionKind::BudgetMap | SectionKind::Critic => Vec::new(),
        });
        let provenance = Provenance {
            version: "0.0.0",
            preset: "none",
            seed,
            steps: 0,
            data_sha256: [0; 32],
            config_sha256: [0; 32],
        };
        let quality = Quality {
            rung: 0,
            limit: Cost::from_raw(5 << 16),
            candidates: 1,
            episodes: 20,
            reward_normalized: 0.25,
            cost_normalized: 0.5,
        };
        let manifest = Manifest {
            task,
            release: 0,
            shape,
            precision: Precision::F32,
            layout: Layout::Rows,
            kappa: KappaRange { scale: 0.05, trained_max: Cost::from_raw((TRAINED_MAX as u32) << 16) },
            schedule,
            rungs: rungs.into_iter().collect(),
            provenance,
            agreement_max_abs: 0.0,
            quality: [quality].into_iter().collect(),
            sections: Default::default(),
        };
        Self { manifest, sections: sections.into() }
    }

    /// Flies a few steps from random states and keeps them as the golden trace.
    pub(crate) fn with_golden(mut self) -> Self {
        let (limit, seed) = (CostLimit::new(5.0).unwrap(), 11);
        let mut memory = aligned();
        let image = self.read(&mut memory);
        let policy = Policy::load(&image).unwrap();
        let mut controller = Controller::<128, 16, 512>::new(policy, limit, seed).unwrap();
        let mut words = vec![seed as u32, (seed >> 32) as u32, limit.cost().to_raw(), GOLDEN_ROWS as u32];
        for row in 0..GOLDEN_ROWS {
            let mut state = vec![0.0; policy.shape().state.into()];
            Noise::new(seed).fill_normal(100, row as u64, &mut state);
            let incurred = if row % 2 == 1 { 1.0 } else { 0.0 };
            let step = controller.step(&state, incurred);
            words.extend(state.iter().chain([&incurred]).map(|value| value.to_bits()));
            words.push(step.kappa.to_raw());
            words.extend(step.action.iter().take(policy.shape().action.into()).map(|value| value.to_bits()));
        }
        self.sections[SectionKind::Golden as usize] = words;
        self
    }

    /// The same with a critic of random weights.
    pub(crate) fn with_critic(mut self, seed: u64) -> Self {
        const TRUNK: usize = 12;
        const HEAD: usize = 9;
        let [s, a] = [self.manifest.shape.state, self.manifest.shape.action].map(usize::from);
        let numbers = (s + 1 + a + 1) * TRUNK + (TRUNK + 1) * TRUNK + 4 * ((TRUNK + 1) * HEAD + HEAD + 1);
        let mut values = vec![0.0; numbers];
        Noise::new(seed).fill_normal(200, 0, &mut values);
        let header = [TRUNK as u32, HEAD as u32, 0.05f32.to_bits(), 0.1f32.to_bits()];
        *self.section(SectionKind::Critic) =
            header.into_iter().chain(values.iter().map(|value| (0.4 * value).to_bits())).collect();
        self
    }

    /// The words of a section.
    pub(crate) fn section(&mut self, kind: SectionKind) -> &mut Vec<u32> {
        &mut self.sections[kind as usize]
    }

    /// The bytes of the image.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        self.read(&mut aligned()).bytes().to_vec()
    }

    fn read<'a>(&self, memory: &'a mut [u128]) -> armor_core::image::PolicyImage<'a> {
        let contents: [&[u32]; SECTION_COUNT] = std::array::from_fn(|i| self.sections[i].as_slice());
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(memory);
        let length = write(&self.manifest, &contents, bytes).unwrap();
        armor_core::image::PolicyImage::new_checked(&bytes[..length]).unwrap()
    }
}

/// Room for an image of the paper's size, and more than a slot of the chip.
fn aligned() -> Vec<u128> {
    vec![0; 4 * 1024 * 1024 / 16]
}
