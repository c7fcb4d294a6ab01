//! Sampling from the policy, `a ~ pi(.|s, kappa)`, with or without a gradient
//! (Eq. 12): the trainer's side of the chain that the controller flies.

use armor_core::schedule::ChainStep;
use nalgebra::DMatrix;

use super::denoiser::{Call, Context, Denoiser};
use crate::nn::{Ahead, Scalar, Weights};

/// Where a chain takes its noise from: `draw(stage, sample, out)` fills `out`
/// `[A]` with standard normal draws; stage 0 is the start `a^N`, stage `i + 1` the
/// noise added by step `i`.
pub type Draw<'a, T> = dyn Fn(usize, usize, &mut [T]) + Sync + 'a;

/// A chain that remembers its calls, for a gradient.
#[derive(Clone, Debug)]
pub struct Chain<T: Scalar> {
    steps: Vec<ChainStep<f64>>,
    /// Steps at the end of the chain that are remembered.
    gradient_steps: usize,
    /// The remembered steps.
    calls: Vec<Call<T>>,
    /// 1 where the estimate `x0` of a step lay within the bounds, 0 where it was clipped.
    inside: Vec<DMatrix<T>>,
    /// The actions, `A x B`: the end of the chain.
    pub action: DMatrix<T>,
}

impl<T: Scalar> Chain<T> {
    /// Room for the given steps on `samples` columns, and for the calls of the last
    /// `gradient_steps` of them, through which a gradient shall flow.
    pub fn new(denoiser: &Denoiser, steps: Vec<ChainStep<f64>>, samples: usize, gradient_steps: usize) -> Self {
        let gradient_steps = gradient_steps.min(steps.len());
        let room = gradient_steps.max(1);
        let action = DMatrix::zeros(denoiser.widths().action, samples);
        let calls = (0..room).map(|_| denoiser.call(samples)).collect();
        Self { calls, inside: vec![action.clone(); room], gradient_steps, steps, action }
    }

    /// Runs the chain in a prepared context; its end is [`Chain::action`].
    ///
    /// A sample whose estimate `x0` is clipped in every entry passes no gradient to
    /// the network at that step: its part of the call is not kept.
    pub fn run<'a>(
        &mut self,
        denoiser: &Denoiser,
        weights: impl Into<Weights<'a, T>>,
        context: &Context<T>,
        draw: &Draw<'_, T>,
    ) {
        let weights = weights.into();
        let rows = self.action.nrows();
        let forgotten = self.steps.len() - self.gradient_steps;
        let mut noise = vec![T::zero(); rows];
        let mut kept = Vec::with_capacity(self.action.ncols());
        for (sample, mut column) in self.action.column_iter_mut().enumerate() {
            draw(0, sample, &mut noise);
            column.copy_from_slice(&noise);
        }
        for (index, step) in self.steps.iter().enumerate() {
            let gradient = index >= forgotten;
            let slot = index.saturating_sub(forgotten);
            let ahead = gradient.then(|| self.written_soon(slot));
            let weights = ahead.as_ref().map_or(weights, |ahead| weights.fetching(ahead));
            let call = &mut self.calls[slot];
            call.action.copy_from(&self.action);
            call.levels.fill(step.n);
            denoiser.forward(weights, context, call, gradient);
            let [from_action, from_noise, to_x0, to_action, sigma] = coefficients::<T>(step);
            for (sample, mut column) in self.action.column_iter_mut().enumerate() {
                if step.sigma != 0.0 {
                    draw(index + 1, sample, &mut noise);
                }
                for (row, action) in column.iter_mut().enumerate() {
                    let estimate = from_action * *action - from_noise * call.noise()[(row, sample)];
                    let (x0, inside) = clip(estimate);
                    self.inside[slot][(row, sample)] = inside;
                    *action = to_x0 * x0 + to_action * *action;
                    if step.sigma != 0.0 {
                        *action += sigma * noise[row];
                    }
                }
            }
            if gradient {
                let inside = self.inside[slot].column_iter();
                kept.clear();
                kept.extend(
                    inside.enumerate().filter(|(_, inside)| inside.iter().any(|x| !x.is_zero())).map(|(i, _)| i),
                );
                call.keep(&kept);
            }
        }
    }

    /// What the products of a call fetch: the later half of what it writes, and the earlier half of the next one.
    fn written_soon(&self, slot: usize) -> Ahead {
        const HALF: usize = 3;
        let next = self.calls.get(slot + 1).into_iter().flat_map(|call| call.written().take(HALF));
        Ahead::new(self.calls[slot].written().skip(HALF).chain(next))
    }

    /// What the products of a backward pass fetch: what it reads last, and what the one after it reads before.
    fn read_soon(&self, slot: usize) -> Ahead {
        const BEFORE: usize = 2;
        let next = self.calls[..slot].last().into_iter().flat_map(|call| call.slopes().take(BEFORE));
        Ahead::new(self.calls[slot].slopes().skip(BEFORE).chain(next))
    }

    /// Back-propagates `action_gradient`, `A x B`, with respect to the end of
    /// the last run, through the remembered steps; adds to `gradient` and to the gradients in `context`.
    pub fn backward<'a>(
        &mut self,
        denoiser: &Denoiser,
        weights: impl Into<Weights<'a, T>>,
        context: &mut Context<T>,
        action_gradient: &DMatrix<T>,
        gradient: &mut [T],
    ) {
        let weights = weights.into();
        let mut after = action_gradient.clone();
        let remembered = &self.steps[self.steps.len() - self.gradient_steps..];
        for (index, (step, inside)) in remembered.iter().zip(&self.inside).enumerate().rev() {
            let ahead = self.read_soon(index);
            let call = &mut self.calls[index];
            let [from_action, from_noise, to_x0, to_action, _] = coefficients::<T>(step);
            // The gradient with respect to the estimate; a clipped entry passes none.
            let estimate = after.component_mul(inside) * to_x0;
            let noise_gradient = estimate.select_columns(call.kept()) * -from_noise;
            call.noise_gradient().columns_mut(0, noise_gradient.ncols()).copy_from(&noise_gradient);
            denoiser.backward(weights.fetching(&ahead), context, call, gradient);
            after = after * to_action + estimate * from_action;
            for (column, &sample) in call.kept().iter().enumerate() {
                let mut sum = after.column_mut(sample);
                sum += call.action_gradient.column(column);
            }
        }
        denoiser.add_body_gradient(&self.calls[..remembered.len()], gradient);
    }
}

/// The coefficients `from_action, from_noise, to_x0, to_action, sigma` of a step.
pub(super) fn coefficients<T: Scalar>(step: &ChainStep<f64>) -> [T; 5] {
    [step.from_action, step.from_noise, step.to_x0, step.to_action, step.sigma].map(T::of)
}

/// A value clipped to the action bounds -1 to 1, and 1 if it lay inside, else 0.
pub(super) fn clip<T: Scalar>(value: T) -> (T, T) {
    let clipped = value.max(-T::one()).min(T::one());
    (clipped, if clipped == value { T::one() } else { T::zero() })
}
