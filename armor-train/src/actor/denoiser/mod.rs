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

mod call;
mod layout;

use nalgebra::DMatrix;

use crate::nn::{Activation, Ahead, Operand, Panels, Passes, Scalar, Tape, Update, Weights, product, sinusoidal_code};

pub use call::Call;
pub use layout::{Denoiser, Widths};

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

impl Denoiser {
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

    /// Back-propagates [`Call::noise_gradient`]: adds the gradient of `W_a` to `gradient` and to the
    /// gradients in `context`, and writes [`Call::action_gradient`]. [`Denoiser::add_body_gradient`] shall follow.
    pub fn backward<'a, T: Scalar>(
        &self,
        weights: impl Into<Weights<'a, T>>,
        context: &mut Context<T>,
        call: &mut Call<T>,
        gradient: &mut [T],
    ) {
        let weights = weights.into();
        let Call { hidden, hidden_slope, body, .. } = call;
        self.body.backward(weights, hidden, body, None, Some((hidden_slope, Update::Multiply)));
        let hidden_gradient = &call.hidden_slope;
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

    /// Adds the gradient of the body after backward passes of `calls`, the last one first.
    ///
    /// Layer by layer, so that the gradient of one stays in the cache while the calls pass by.
    pub fn add_body_gradient<T: Scalar>(&self, calls: &[Call<T>], gradient: &mut [T]) {
        for layer in (0..self.body.layers().len()).rev() {
            for (index, call) in calls.iter().enumerate().rev() {
                let next = calls[..index].last().into_iter().flat_map(|next| next.body.around(layer, &next.hidden));
                let ahead = Ahead::new(next.map(|matrix| matrix.values()));
                self.body.add_layer_gradient(layer, &call.hidden, &call.body, gradient, &ahead);
            }
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
