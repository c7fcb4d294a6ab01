//! What an action computes, counted by kind from an image's shape and chain.

use armor_core::image::{PolicyImage, Precision};
use armor_core::schedule::ChainStep;
use armor_core::shape::Shape;

/// The operations of one action along a rung.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Multiply-accumulates in the image's precision.
    pub macs: u64,
    /// Multiply-accumulates in single precision beside them: the kappa embedding of an integer image.
    pub float_macs: u64,
    /// Mish of a unit in the image's precision.
    pub activations: u64,
    /// Mish of a unit in single precision beside those.
    pub float_activations: u64,
    /// Sums of integers that are rescaled; 0 in single precision.
    pub rescales: u64,
    /// Entries of states, embeddings and actions that are normalised or put into codes.
    pub entries: u64,
    /// Normal draws.
    pub normals: u64,
    /// Calls of the denoiser.
    pub steps: u64,
    /// Bytes of weights that are read, each as often as it is.
    pub weight_bytes: u64,
}

impl Work {
    /// The work of an action along rung `rung`; none if the image has no such rung.
    pub fn of(image: &PolicyImage<'_>, rung: usize) -> Option<Self> {
        let manifest = image.manifest();
        let steps = manifest.rungs.get(rung)?.steps;
        let noisy = |step: &ChainStep| step.sigma != 0.0;
        let noisy_steps = image.sections().chain(manifest, rung).filter(noisy).count() as u16;
        Some(Self::new(&manifest.shape, manifest.precision, steps, noisy_steps))
    }

    /// The work of `steps` calls of a network, `noisy_steps` of which draw noise.
    pub fn new(shape: &Shape, precision: Precision, steps: u16, noisy_steps: u16) -> Self {
        let (steps, noisy_steps) = (u64::from(steps), u64::from(noisy_steps));
        let [s, a, h, k, e] =
            [shape.state, shape.action, shape.hidden, shape.kappa_hidden, shape.kappa_embedding].map(u64::from);
        let is_integer = precision.code_bits().is_some();

        let embedding = k + k * k + k * e;
        let context = (s + e) * h;
        // An integer image holds its output layer in two parts.
        let output = if is_integer { 2 * h * a } else { h * a };
        let step = a * h + 2 * h * h + output;
        let weight = if is_integer { 1 } else { 4 };
        Self {
            macs: context + steps * step + if is_integer { 0 } else { embedding },
            float_macs: if is_integer { embedding } else { 0 },
            activations: steps * 3 * h + if is_integer { 0 } else { 2 * k },
            float_activations: if is_integer { 2 * k } else { 0 },
            rescales: if is_integer { 2 * h + steps * (2 * h + a) } else { 0 },
            entries: s + e + steps * 2 * a,
            normals: a * (1 + noisy_steps),
            steps,
            weight_bytes: weight * (context + steps * step) + 4 * embedding,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;
    use crate::memory::AlignedBytes;

    /// By hand: S 7, A 2, H 16, K 4, E 3; five DDPM steps, of which the last draws no noise, and two DDIM steps.
    #[test]
    fn the_work_of_the_fixture_is_counted() {
        let memory = AlignedBytes::from(fixture::ball_run(1).as_slice());
        let image = PolicyImage::new_checked(memory.as_slice()).unwrap();
        let full = Work::of(&image, 0).unwrap();
        let shape = image.manifest().shape;
        assert_eq!(full.macs, shape.macs_once() + 5 * shape.macs_per_step());
        assert_eq!((full.activations, full.rescales, full.float_macs), (5 * 48 + 8, 0, 0));
        assert_eq!((full.normals, full.entries, full.steps), (2 * 5, 10 + 5 * 4, 5));
        assert_eq!(full.weight_bytes, 4 * (32 + 160 + 5 * 576));
        let short = Work::of(&image, 1).unwrap();
        assert_eq!((short.normals, short.steps), (2, 2));
        assert_eq!(Work::of(&image, 2), None);
    }
}
