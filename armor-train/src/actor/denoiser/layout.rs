//! The layout of the noise predictor within its parameters.

use std::ops::Range;

use crate::nn::{Activation, Frequencies, Linear, Mlp, Scalar};

/// Widths of the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Widths {
    /// Entries of the state.
    pub state: usize,
    /// Entries of the action.
    pub action: usize,
    /// Units of the three hidden layers.
    pub hidden: usize,
    /// Hidden units of the kappa embedding.
    pub kappa_hidden: usize,
    /// Entries of the kappa embedding.
    pub kappa_embedding: usize,
    /// Entries of the sinusoidal code of a step.
    pub time_code: usize,
    /// Hidden units of the time embedding.
    pub time_hidden: usize,
    /// Entries of the time embedding.
    pub time_embedding: usize,
    /// Noise levels `N`.
    pub steps: usize,
}

/// Layout of the network within its parameters: kappa MLP, time MLP, first layer, body, and
/// the frequencies of the step's code where they are learnt.
#[derive(Clone, Debug)]
pub struct Denoiser {
    pub(super) widths: Widths,
    pub(super) kappa_scale: f64,
    /// Whether the noisy action enters the network.
    pub(super) sees_action: bool,
    pub(super) kappa: Mlp,
    pub(super) time: Mlp,
    pub(super) first: Linear,
    pub(super) body: Mlp,
    pub(super) frequencies: Option<Frequencies>,
}

impl Denoiser {
    /// The layout for given widths; the network sees `kappa_scale * kappa`.
    pub fn new(widths: Widths, kappa_scale: f64) -> Self {
        let Widths {
            state, action, hidden, kappa_hidden, kappa_embedding, time_code, time_hidden, time_embedding, ..
        } = widths;
        let kappa = Mlp::new(&[1, kappa_hidden, kappa_hidden, kappa_embedding], 0, Activation::Mish, None);
        let time = Mlp::new(&[time_code, time_hidden, time_embedding], kappa.end(), Activation::Mish, None);
        let inputs = action + state + kappa_embedding + time_embedding;
        let first = Linear { inputs, outputs: hidden, offset: time.end() };
        let body = Mlp::new(&[hidden, hidden, hidden, action], first.end(), Activation::Mish, None);
        Self { widths, kappa_scale, sees_action: true, kappa, time, first, body, frequencies: None }
    }

    /// The same layout with frequencies of the step's code that are learnt (O-9).
    pub fn with_learned_frequencies(self) -> Self {
        let frequencies = Frequencies { count: self.widths.time_code / 2, offset: self.body.end() };
        Self { frequencies: Some(frequencies), ..self }
    }

    /// The same layout for a network that does not see the noisy action, `W_a = 0` for good.
    pub fn blind(self) -> Self {
        Self { sees_action: false, ..self }
    }

    /// Widths of the network.
    pub const fn widths(&self) -> &Widths {
        &self.widths
    }

    /// The factor on kappa.
    pub const fn kappa_scale(&self) -> f64 {
        self.kappa_scale
    }

    /// The kappa embedding.
    pub const fn kappa(&self) -> &Mlp {
        &self.kappa
    }

    /// The time embedding.
    pub const fn time(&self) -> &Mlp {
        &self.time
    }

    /// The layer that noisy action, state and both embeddings enter.
    pub const fn first(&self) -> &Linear {
        &self.first
    }

    /// What follows the first layer.
    pub const fn body(&self) -> &Mlp {
        &self.body
    }

    /// Numbers of the network.
    pub fn size(&self) -> usize {
        self.frequencies.as_ref().map_or(self.body.end(), Frequencies::end)
    }

    /// Inputs of the first layer that are the noisy action, the state, the kappa and the time embedding.
    pub fn blocks(&self) -> [Range<usize>; 4] {
        let w = &self.widths;
        let mut end = 0;
        [w.action, w.state, w.kappa_embedding, w.time_embedding].map(|width| {
            end += width;
            end - width..end
        })
    }

    /// PyTorch's default initialisation from draws in `[0, 1)`.
    pub fn initialise<T: Scalar>(&self, parameters: &mut [T], draws: &mut impl Iterator<Item = f64>) {
        self.kappa.initialise(parameters, draws);
        self.time.initialise(parameters, draws);
        self.first.initialise(parameters, draws);
        if !self.sees_action {
            let [of_action, ..] = self.blocks();
            parameters[self.first.offset..][..of_action.len() * self.first.outputs].fill(T::zero());
        }
        self.body.initialise(parameters, draws);
        if let Some(frequencies) = &self.frequencies {
            frequencies.initialise(parameters, draws);
        }
    }
}
