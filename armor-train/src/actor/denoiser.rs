//! The noise predictor `eps(a^n, s, kappa, n)` (Appendix B), forward and backward.
//!
//! ```text
//! e_k = kappa MLP(scale kappa)          e_n = time MLP(code(n))
//! h_1 = mish(W_a a + W_n e_n + (W_s s + W_k e_k + b))
//! eps = body(h_1)                       two more hidden layers, then linear
//! ```
//!
//! The bracket is the [`Context`]: it does not change along a chain, so it is
//! computed once; `W_n e_n` has only `N` different values, the time table.

use std::ops::Range;

use nalgebra::DMatrix;

use crate::nn::{
    Activation, Frequencies, Linear, Mlp, Operand, Panels, Passes, Scalar, Tape, Update, Weights, keep_columns,
    product, sinusoidal_code,
};

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
    widths: Widths,
    kappa_scale: f64,
    /// Whether the noisy action enters the network.
    sees_action: bool,
    kappa: Mlp,
    time: Mlp,
    first: Linear,
    body: Mlp,
    frequencies: Option<Frequencies>,
}

/// What stays the same along a chain, and the gradients that flow back into it.
#[derive(Clone, Debug)]
pub struct Context<T: Scalar> {
    kappa_input: DMatrix<T>,
    kappa: Tape<T>,
    time_code: DMatrix<T>,
    time_code_gradient: DMatrix<T>,
    time: Tape<T>,
    /// `W_s s + W_k e_k + b`, `H x B`.
    constant: DMatrix<T>,
    constant_gradient: DMatrix<T>,
    /// `W_n e_n`, `H x N`; column `n - 1` for noise level `n`.
    table: DMatrix<T>,
    table_gradient: DMatrix<T>,
}

/// One call of the network.
#[derive(Clone, Debug)]
pub struct Call<T: Scalar> {
    /// Noisy actions, `A x B`: the input.
    pub action: DMatrix<T>,
    /// Noise level of each sample, `1..=N`: the input.
    pub levels: Vec<usize>,
    /// Gradient with respect to the noisy actions, `A x B`, after a backward pass.
    pub action_gradient: DMatrix<T>,
    /// The samples that the leading columns belong to, ascending: all, or those kept for the backward pass.
    kept: Vec<usize>,
    hidden: DMatrix<T>,
    hidden_slope: DMatrix<T>,
    hidden_gradient: DMatrix<T>,
    body: Tape<T>,
}

impl<T: Scalar> Call<T> {
    /// The predicted noise, `A x B`.
    pub fn noise(&self) -> &DMatrix<T> {
        self.body.output()
    }

    /// Frees the room of the gradients; [`Call::swap_gradients`] gives it another.
    pub fn free_gradients(&mut self) {
        self.hidden_gradient = DMatrix::zeros(0, 0);
        self.body.free_gradients();
    }

    /// Exchanges the room of the gradients, which need not outlive a backward pass.
    pub fn swap_gradients(&mut self, other: &mut Self) {
        std::mem::swap(&mut self.hidden_gradient, &mut other.hidden_gradient);
        self.body.swap_gradients(&mut other.body);
    }

    /// Where the gradient with respect to the predicted noise is written.
    pub fn noise_gradient(&mut self) -> &mut DMatrix<T> {
        self.body.output_gradient()
    }

    /// Keeps these samples (ascending) for the backward pass, whose gradients then
    /// stand in the leading columns; the noise gradient of the others is zero.
    pub fn keep(&mut self, samples: &[usize]) {
        keep_columns(&mut self.action, samples);
        keep_columns(&mut self.hidden, samples);
        keep_columns(&mut self.hidden_slope, samples);
        self.body.keep(samples);
        self.kept.clear();
        self.kept.extend_from_slice(samples);
    }

    /// The samples of the backward pass, column by column.
    pub fn kept(&self) -> &[usize] {
        &self.kept
    }
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

    /// The parameters, with copies of the weights that every call of a chain reads.
    pub fn pack<'a, T: Scalar>(&self, parameters: &'a [T], passes: Passes) -> Panels<'a, T> {
        Panels::new(self.body.layers().iter(), parameters, passes)
    }

    /// Room for the context of `samples` columns.
    pub fn context<T: Scalar>(&self, samples: usize) -> Context<T> {
        let Widths { hidden, steps, time_code, .. } = self.widths;
        Context {
            kappa_input: DMatrix::zeros(1, samples),
            kappa: self.kappa.tape(samples),
            time_code: sinusoidal_code(time_code, steps),
            time_code_gradient: DMatrix::zeros(time_code, steps),
            time: self.time.tape(steps),
            constant: DMatrix::zeros(hidden, samples),
            constant_gradient: DMatrix::zeros(hidden, samples),
            table: DMatrix::zeros(hidden, steps),
            table_gradient: DMatrix::zeros(hidden, steps),
        }
    }

    /// Room for one call on `samples` columns.
    pub fn call<T: Scalar>(&self, samples: usize) -> Call<T> {
        let hidden = || DMatrix::zeros(self.widths.hidden, samples);
        let action = || DMatrix::zeros(self.widths.action, samples);
        Call {
            kept: Vec::with_capacity(samples),
            action: action(),
            levels: vec![1; samples],
            action_gradient: action(),
            hidden: hidden(),
            hidden_slope: hidden(),
            hidden_gradient: hidden(),
            body: self.body.tape(samples),
        }
    }

    /// Computes the context of states `S x B` and budgets `[B]`, and forgets the gradients in it.
    pub fn prepare<'a, T: Scalar>(
        &self,
        weights: impl Into<Weights<'a, T>>,
        state: &DMatrix<T>,
        kappa: &[T],
        context: &mut Context<T>,
    ) {
        let parameters = weights.into().parameters();
        let scale = T::of(self.kappa_scale);
        for (input, &kappa) in context.kappa_input.iter_mut().zip(kappa) {
            *input = scale * kappa;
        }
        self.kappa.forward(parameters, &context.kappa_input, &mut context.kappa, true);
        if let Some(frequencies) = &self.frequencies {
            frequencies.code(parameters, &mut context.time_code);
        }
        self.time.forward(parameters, &context.time_code, &mut context.time, true);

        let [_, of_state, of_kappa, of_time] = self.blocks();
        let constant = context.constant.as_mut_slice();
        for column in constant.chunks_exact_mut(self.first.outputs) {
            column.copy_from_slice(self.first.bias(parameters));
        }
        product(constant, self.first.block(parameters, of_state), state.into(), Update::Add);
        product(constant, self.first.block(parameters, of_kappa), context.kappa.output().into(), Update::Add);
        let table = context.table.as_mut_slice();
        product(table, self.first.block(parameters, of_time), context.time.output().into(), Update::Replace);
        context.constant_gradient.fill(T::zero());
        context.table_gradient.fill(T::zero());
    }

    /// Predicts the noise in `call.action` at `call.levels`; with `slopes`, a backward pass may follow.
    pub fn forward<'a, T: Scalar>(
        &self,
        weights: impl Into<Weights<'a, T>>,
        context: &Context<T>,
        call: &mut Call<T>,
        slopes: bool,
    ) {
        let weights = weights.into();
        call.kept.clear();
        call.kept.extend(0..call.action.ncols());
        let hidden = call.hidden.as_mut_slice();
        if self.sees_action {
            let [of_action, ..] = self.blocks();
            let of_action = self.first.block(weights.parameters(), of_action);
            product(hidden, of_action, (&call.action).into(), Update::Plus(context.constant.as_slice()));
        } else {
            hidden.copy_from_slice(context.constant.as_slice());
        }
        let slopes_of = slopes.then(|| call.hidden_slope.as_mut_slice());
        Activation::Mish.apply_by_level(hidden, slopes_of, &context.table, &call.levels);
        self.body.forward(weights, &call.hidden, &mut call.body, slopes);
    }

    /// Back-propagates [`Call::noise_gradient`]: adds to `gradient` and to the
    /// gradients in `context`, and writes [`Call::action_gradient`].
    pub fn backward<'a, T: Scalar>(
        &self,
        weights: impl Into<Weights<'a, T>>,
        context: &mut Context<T>,
        call: &mut Call<T>,
        gradient: &mut [T],
    ) {
        let weights = weights.into();
        let Call { hidden, hidden_slope, hidden_gradient, body, .. } = call;
        let below = (&mut *hidden_gradient, Update::Times(hidden_slope.as_slice()));
        self.body.backward(weights, hidden, body, Some(gradient), Some(below));
        let columns = call.kept.len();

        // A network that does not see the action leaves its gradient at zero.
        if self.sees_action {
            let [of_action, ..] = self.blocks();
            let (delta, action) = (Operand::leading(hidden_gradient, columns), Operand::leading(&call.action, columns));
            self.first.add_block_gradient(gradient, of_action.clone(), delta, action);
            let of_action = self.first.block(weights.parameters(), of_action).transposed();
            let action_gradient = &mut call.action_gradient.as_mut_slice()[..self.widths.action * columns];
            product(action_gradient, of_action, delta, Update::Replace);
        }
        for (column, &sample) in hidden_gradient.column_iter().zip(&call.kept) {
            let mut constant_sum = context.constant_gradient.column_mut(sample);
            constant_sum += &column;
            let mut table_sum = context.table_gradient.column_mut(call.levels[sample] - 1);
            table_sum += column;
        }
    }

    /// Carries the gradients in `context` on to the embeddings and the rest of the first layer.
    pub fn finish<'a, T: Scalar>(
        &self,
        weights: impl Into<Weights<'a, T>>,
        state: &DMatrix<T>,
        context: &mut Context<T>,
        gradient: &mut [T],
    ) {
        let parameters = weights.into().parameters();
        let [_, of_state, of_kappa, of_time] = self.blocks();
        let Context {
            kappa_input, kappa, time_code, time_code_gradient, time, constant_gradient, table_gradient, ..
        } = context;
        let delta = Operand::from(&*constant_gradient);
        self.first.add_block_gradient(gradient, of_state, delta, state.into());
        self.first.add_block_gradient(gradient, of_kappa.clone(), delta, kappa.output().into());
        self.first.add_bias_gradient(gradient, delta);
        self.first.add_block_gradient(gradient, of_time.clone(), (&*table_gradient).into(), time.output().into());

        let back = |block, from: &DMatrix<T>, tape: &mut Tape<T>| {
            let weights = self.first.block(parameters, block).transposed();
            product(tape.output_gradient().as_mut_slice(), weights, Operand::from(from), Update::Replace);
        };
        back(of_kappa, constant_gradient, kappa);
        self.kappa.backward(parameters, kappa_input, kappa, Some(gradient), None);
        back(of_time, table_gradient, time);
        match &self.frequencies {
            None => self.time.backward(parameters, time_code, time, Some(gradient), None),
            Some(frequencies) => {
                self.time.backward(
                    parameters,
                    time_code,
                    time,
                    Some(gradient),
                    Some((time_code_gradient, Update::Replace)),
                );
                frequencies.add_gradient(time_code, time_code_gradient, gradient);
            }
        }
    }

    /// The time table, `H x N`, as an image stores it.
    pub fn time_table<T: Scalar>(&self, parameters: &[T]) -> DMatrix<T> {
        let mut context = self.context(1);
        self.prepare(parameters, &DMatrix::zeros(self.widths.state, 1), &[T::zero()], &mut context);
        context.table
    }
}
