//! The denoiser `eps(a^n, n | s, kappa)` of Appendix B, with everything that
//! is constant along a chain computed once ([`armor_core::shape`] has the
//! formulas). `docs/numerics.md` says in which order sums are taken and how
//! integers are rounded.

mod float;
mod integer;

use armor_core::image::{Dense, Network};
use armor_core::units::Cost;

use crate::kernel::Kernel;
use crate::policy::Policy;
use float::FloatDenoiser;
use integer::IntegerDenoiser;

/// A denoiser met a number that is NaN or infinite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NotFinite;

/// The working memory of a denoiser, for the number format of its policy and
/// for `K` noisy actions at a time.
pub(crate) enum Denoiser<const STATE: usize, const HIDDEN: usize, const K: usize> {
    Float(FloatDenoiser<STATE, HIDDEN, K>),
    Integer(IntegerDenoiser<STATE, HIDDEN, K>),
}

impl<const STATE: usize, const HIDDEN: usize, const K: usize> Denoiser<STATE, HIDDEN, K> {
    /// Memory that no policy has yet.
    pub(crate) const fn idle() -> Self {
        Self::Float(FloatDenoiser::new())
    }

    /// Becomes memory for a policy within these capacities.
    pub(crate) fn suit(&mut self, policy: &Policy<'_>) {
        match policy.sections.network {
            Network::Float(_) => *self = Self::Float(FloatDenoiser::new()),
            Network::Integer(_) => *self = Self::Integer(IntegerDenoiser::new()),
        }
    }

    /// Memory for a policy within these capacities.
    #[cfg(test)]
    pub(crate) fn new(policy: &Policy<'_>) -> Self {
        let mut denoiser = Self::idle();
        denoiser.suit(policy);
        denoiser
    }

    /// Computes what a chain of `policy` needs of the state `[S]` and the
    /// remaining budget.
    ///
    /// # Errors
    /// [`NotFinite`] where an integer policy cannot put the state or the
    /// embedding into codes. In single precision such numbers pass on, and the
    /// chain's estimate shows them.
    pub(crate) fn prepare(&mut self, policy: &Policy<'_>, state: &[f32], kappa: Cost) -> Result<(), NotFinite> {
        if let (Self::Float(_), Network::Integer(_)) = (&*self, &policy.sections.network) {
            self.suit(policy);
        }
        match (self, &policy.sections.network) {
            (Self::Float(memory), Network::Float(network)) if cfg!(feature = "float") => {
                memory.prepare(policy, network, state, kappa);
                Ok(())
            }
            (Self::Integer(memory), Network::Integer(network)) if cfg!(feature = "integer") => {
                memory.prepare(policy, network, state, kappa)
            }
            // A policy loads only where its format was built in, and memory is made for its policy.
            _ => Err(NotFinite),
        }
    }

    /// The noise that the network sees in each of the actions, `[A]` entries of
    /// `K`, at noise level `n`, into `eps`, given what [`Denoiser::prepare`] left.
    pub(crate) fn eps(&mut self, policy: &Policy<'_>, n: usize, action: &[[f32; K]], eps: &mut [[f32; K]]) {
        match (self, &policy.sections.network) {
            (Self::Float(memory), Network::Float(network)) if cfg!(feature = "float") => {
                memory.eps(policy, network, n, action, eps);
            }
            (Self::Integer(memory), Network::Integer(network)) if cfg!(feature = "integer") => {
                memory.eps(policy, network, n, action, eps);
            }
            _ => {}
        }
    }

    /// The memory for single precision, made anew where integers are in it;
    /// the next [`Denoiser::prepare`] finds its own again.
    pub(crate) fn float_memory(&mut self) -> Option<&mut FloatDenoiser<STATE, HIDDEN, K>> {
        if let Self::Integer(_) = self {
            *self = Self::Float(FloatDenoiser::new());
        }
        match self {
            Self::Float(memory) => Some(memory),
            Self::Integer(_) => None,
        }
    }
}

/// The kappa embedding, in single precision for every policy: it is small, and
/// computed once an action. `first` and `second` are its working memory.
fn kappa_embedding<'m>(policy: &Policy<'_>, kappa: Cost, first: &'m mut [f32], second: &mut [f32]) -> &'m mut [f32] {
    let [k, e] = [policy.shape.kappa_hidden, policy.shape.kappa_embedding].map(usize::from);
    let [layer_1, layer_2, layer_3] = &policy.sections.kappa;
    let kernel = policy.kernel;
    let hidden = front(first, k);
    affine(kernel, layer_1, &[policy.kappa.scale * policy.condition(kappa)], hidden);
    kernel.mish(hidden);
    let second = front(second, k);
    affine(kernel, layer_2, hidden, second);
    kernel.mish(second);
    let embedding = front(first, e);
    affine(kernel, layer_3, second, embedding);
    embedding
}

/// The normalised entries of a state `[S]`.
pub(crate) fn normalised<'s>(policy: &Policy<'s>, state: &'s [f32]) -> impl Iterator<Item = f32> + Clone + use<'s> {
    let normaliser = policy.sections.state_mean.iter().zip(policy.sections.state_factor);
    state.iter().zip(normaliser).map(|(value, (mean, factor))| (value - mean) * factor)
}

/// The first `length` entries of a buffer, or none if it is shorter; the
/// controller has checked that no buffer is.
pub(crate) fn front<T>(buffer: &mut [T], length: usize) -> &mut [T] {
    buffer.get_mut(..length).unwrap_or_default()
}

/// `out = bias + W x` for `K` columns.
pub(crate) fn affine_columns<const K: usize>(kernel: Kernel, layer: &Dense<'_>, x: &[[f32; K]], out: &mut [[f32; K]]) {
    for (out, bias) in out.iter_mut().zip(layer.bias) {
        *out = [*bias; K];
    }
    kernel.accumulate_columns(layer.weights, x, out);
}

/// `out = bias + W x`.
pub(crate) fn affine(kernel: Kernel, layer: &Dense<'_>, x: &[f32], out: &mut [f32]) {
    for (out, bias) in out.iter_mut().zip(layer.bias) {
        *out = *bias;
    }
    kernel.accumulate(layer.weights, x, out);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{Fixture, Parts, SMALL};
    use armor_core::image::{Precision, SectionKind};
    use armor_core::shape::Shape;

    fn fixture(shape: Shape, precision: Precision) -> Parts {
        match precision {
            Precision::F32 => Fixture::random(shape, 1),
            integers => Fixture::integers(shape, integers, 1),
        }
    }

    /// A map through (b, b) and (2b, b) is the budget itself up to b, and holds b from there on.
    #[test]
    fn a_mapped_budget_has_the_bits_of_the_budget_it_maps_to() {
        let knot = |budget: u32, condition: f32| [budget << 16, condition.to_bits()];
        let eps = |fixture: &Fixture, kappa: f32| {
            let image = fixture.image();
            let (policy, kappa) = (Policy::load(&image).unwrap(), Cost::from_incurred(kappa).unwrap());
            let mut denoiser = Denoiser::<16, 256, 1>::new(&policy);
            let mut eps = [[0.0]; 2];
            denoiser.prepare(&policy, &[0.5, -0.5, 1.0], kappa).unwrap();
            denoiser.eps(&policy, 1, &[[0.25], [-1.0]], &mut eps);
            eps.map(|[value]| value.to_bits())
        };
        for precision in [Precision::F32, Precision::Int16x8, Precision::Int8] {
            let plain = fixture(SMALL, precision);
            let mut mapped = plain.clone();
            *mapped.section(SectionKind::BudgetMap) = [knot(0, 0.0), knot(8, 8.0), knot(16, 8.0)].concat();
            let (plain, mapped) = (plain.build(), mapped.build());
            for (kappa, seen) in [(0.0, 0.0), (3.25, 3.25), (8.0, 8.0), (11.0, 8.0), (40.0, 8.0)] {
                assert_eq!(eps(&mapped, kappa), eps(&plain, seen), "{precision:?}, {kappa}");
            }
            assert_ne!(eps(&plain, 3.25), eps(&plain, 8.0), "{precision:?}");
        }
    }

    /// What the default network may take of a small flash.
    #[test]
    fn the_default_network_in_8_bits_is_within_190_kib() {
        let shape = Shape { state: 60, action: 2, hidden: 256, kappa_hidden: 32, kappa_embedding: 16, steps: 20 };
        let bytes = fixture(shape, Precision::Int8).build().image().bytes().len();
        assert!(bytes <= 190 * 1024, "{bytes} bytes");
    }
}
