//! The dual variable `lambda(kappa)` (Eqs. 15 and 16): a small network of the
//! remaining budget, raised where the predicted cost exceeds it.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::nn::{Activation, Mlp, Scalar, Tape};

/// What the clip of `log lambda` passes back (O-16).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DualClip {
    /// No gradient outside the range: what `exp(clip(z))` says.
    ZeroGradient,
    /// The gradient as if it were not there, so that lambda can come back.
    StraightThrough,
}

/// Choices of the dual variable (O-16); the default is the paper's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DualOptions {
    /// `log lambda` is clipped to this range (Appendix B).
    pub log_range: [f64; 2],
    /// What the clip passes back.
    pub clip: DualClip,
    /// Whether the last layer starts at 0, and so lambda at 1.
    pub starts_at_one: bool,
}

impl Default for DualOptions {
    fn default() -> Self {
        Self { log_range: [-20.0, 5.0], clip: DualClip::ZeroGradient, starts_at_one: false }
    }
}

/// Layout of the dual network: `lambda(kappa) = exp(clip(z(scale kappa), -20, 5))`.
#[derive(Clone, Debug)]
pub struct Dual {
    options: DualOptions,
    kappa_scale: f64,
    network: Mlp,
}

/// What a forward pass leaves behind.
#[derive(Clone, Debug)]
pub struct DualTape<T: Scalar> {
    input: DMatrix<T>,
    network: Tape<T>,
    /// `lambda(kappa)` `[B]`.
    pub lambda: Vec<T>,
}

impl Dual {
    /// Two hidden layers of `hidden` units with ReLU; the network sees `kappa_scale * kappa`.
    pub fn new(options: DualOptions, hidden: usize, kappa_scale: f64) -> Self {
        Self { options, kappa_scale, network: Mlp::new(&[1, hidden, hidden, 1], 0, Activation::Relu, None) }
    }

    /// Numbers of the network.
    pub fn size(&self) -> usize {
        self.network.end()
    }

    /// PyTorch's default initialisation from draws in `[0, 1)`.
    pub fn initialise<T: Scalar>(&self, parameters: &mut [T], draws: &mut impl Iterator<Item = f64>) {
        self.network.initialise(parameters, draws);
        if let (true, Some(last)) = (self.options.starts_at_one, self.network.layers().last()) {
            parameters[last.offset..last.end()].fill(T::zero());
        }
    }

    /// Room for passes over `samples` budgets.
    pub fn tape<T: Scalar>(&self, samples: usize) -> DualTape<T> {
        DualTape {
            input: DMatrix::zeros(1, samples),
            network: self.network.tape(samples),
            lambda: vec![T::zero(); samples],
        }
    }

    /// Computes `lambda(kappa)`.
    pub fn forward<T: Scalar>(&self, parameters: &[T], kappa: &[T], tape: &mut DualTape<T>) {
        let scale = T::of(self.kappa_scale);
        for (input, &kappa) in tape.input.iter_mut().zip(kappa) {
            *input = scale * kappa;
        }
        self.network.forward(parameters, &tape.input, &mut tape.network, true);
        let [low, high] = self.options.log_range.map(T::of);
        for (lambda, &log) in tape.lambda.iter_mut().zip(tape.network.output()) {
            *lambda = log.max(low).min(high).exp();
        }
    }

    /// Adds the gradient of Eq. 16 to `gradient` after a forward pass:
    /// `L = -mean_b lambda_b violation_b`, with `violation = Q_cL - kappa` held
    /// fixed and the mean over `batch` samples. Returns the summed loss.
    pub fn backward<T: Scalar>(
        &self,
        parameters: &[T],
        violation: &[T],
        batch: usize,
        tape: &mut DualTape<T>,
        gradient: &mut [T],
    ) -> f64 {
        let [low, high] = self.options.log_range.map(T::of);
        let share = T::of(1.0 / batch as f64);
        let mut loss = 0.0;
        for (sample, (&lambda, &violation)) in tape.lambda.iter().zip(violation).enumerate() {
            loss -= (lambda * violation).to_f64();
            let log = tape.network.output()[sample];
            let passes = self.options.clip == DualClip::StraightThrough || log >= low && log <= high;
            tape.network.output_gradient()[sample] = if passes { -lambda * violation * share } else { T::zero() };
        }
        self.network.backward(parameters, &tape.input, &mut tape.network, Some(gradient), None);
        loss
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::Adam;
    use crate::testing::{assert_gradient, fill};

    const KAPPA: [f64; 4] = [0.0, 1.0, 4.0, 20.0];

    #[test]
    fn gradient_is_that_of_finite_differences() {
        let dual = Dual::new(DualOptions::default(), 6, 0.1);
        let parameters = fill(dual.size(), 1);
        let violation = fill(4, 2);
        let loss = |parameters: &[f64]| {
            let mut tape = dual.tape(4);
            dual.forward(parameters, &KAPPA, &mut tape);
            dual.backward(parameters, &violation, 4, &mut tape, &mut vec![0.0; dual.size()]) / 4.0
        };
        let mut tape = dual.tape(4);
        let mut gradient = vec![0.0; dual.size()];
        dual.forward(&parameters, &KAPPA, &mut tape);
        dual.backward(&parameters, &violation, 4, &mut tape, &mut gradient);
        assert_gradient(&parameters, &gradient, loss);
    }

    fn after_ascent(violation: f64) -> (f64, f64) {
        let dual = Dual::new(DualOptions::default(), 6, 0.1);
        let mut parameters = fill(dual.size(), 1);
        let mut tape = dual.tape(4);
        dual.forward(&parameters, &KAPPA, &mut tape);
        let before = tape.lambda[1];
        let mut adam = Adam::new(dual.size(), 1e-2);
        for _ in 0..2000 {
            let mut gradient = vec![0.0; dual.size()];
            dual.forward(&parameters, &KAPPA, &mut tape);
            dual.backward(&parameters, &[violation; 4], 4, &mut tape, &mut gradient);
            adam.descend(&mut parameters, &gradient);
        }
        dual.forward(&parameters, &KAPPA, &mut tape);
        (before, tape.lambda[1])
    }

    #[test]
    fn a_violated_budget_raises_lambda_up_to_its_cap_and_a_kept_one_lowers_it() {
        let (before, raised) = after_ascent(1.0);
        let (_, lowered) = after_ascent(-1.0);
        assert!(lowered < before && before < raised);
        assert!(raised <= 5f64.exp() && raised > 0.99 * 5f64.exp());
        assert!(lowered >= (-20f64).exp());
    }

    /// The gradient of the last layer's bias, which is that of `log lambda`, far outside the range.
    fn gradient_beyond(clip: DualClip) -> f64 {
        let dual = Dual::new(DualOptions { clip, log_range: [-1.0, 1.0], ..DualOptions::default() }, 2, 1.0);
        let mut parameters = vec![0.0; dual.size()];
        *parameters.last_mut().unwrap() = 3.0;
        let (mut tape, mut gradient) = (dual.tape(1), vec![0.0; dual.size()]);
        dual.forward(&parameters, &[3.0], &mut tape);
        dual.backward(&parameters, &[-0.5], 1, &mut tape, &mut gradient);
        *gradient.last().unwrap()
    }

    #[test]
    fn only_a_straight_through_clip_lets_lambda_come_back() {
        assert_eq!(gradient_beyond(DualClip::ZeroGradient), 0.0);
        assert!((gradient_beyond(DualClip::StraightThrough) - 0.5 * 1f64.exp()).abs() < 1e-12);
    }

    #[test]
    fn lambda_starts_at_one_where_asked() {
        let lambda = |starts_at_one| {
            let dual = Dual::new(DualOptions { starts_at_one, ..DualOptions::default() }, 4, 1.0);
            let mut parameters = vec![0.0; dual.size()];
            dual.initialise(&mut parameters, &mut fill(dual.size(), 1).into_iter());
            let mut tape = dual.tape(4);
            dual.forward(&parameters, &KAPPA, &mut tape);
            tape.lambda
        };
        assert_eq!(lambda(true), [1.0; 4]);
        assert!(lambda(false).iter().all(|lambda| *lambda != 1.0));
    }

    #[test]
    fn beyond_the_clip_lambda_stays_at_its_bound() {
        let dual = Dual::new(DualOptions::default(), 2, 1.0);
        let mut parameters = vec![0.0; dual.size()];
        for (bias, bound) in [(-30.0, (-20f64).exp()), (9.0, 148.413_159_102_576_6)] {
            *parameters.last_mut().unwrap() = bias;
            let mut tape = dual.tape(1);
            dual.forward(&parameters, &[3.0], &mut tape);
            assert!((tape.lambda[0] / bound - 1.0).abs() < 1e-12);
        }
    }
}
