//! The dual variable `lambda(kappa)` (Eqs. 15 and 16): a small network of the
//! remaining budget, raised where the predicted cost exceeds it.

use nalgebra::DMatrix;

use crate::nn::{Activation, Mlp, Scalar, Tape};

/// `log lambda` is clipped to this range (Appendix B); outside it the gradient is zero.
pub const LOG_RANGE: [f64; 2] = [-20.0, 5.0];

/// Layout of the dual network: `lambda(kappa) = exp(clip(z(scale kappa), -20, 5))`.
#[derive(Clone, Debug)]
pub struct Dual {
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
    pub fn new(hidden: usize, kappa_scale: f64) -> Self {
        Self { kappa_scale, network: Mlp::new(&[1, hidden, hidden, 1], 0, Activation::Relu, None) }
    }

    /// Numbers of the network.
    pub fn size(&self) -> usize {
        self.network.end()
    }

    /// PyTorch's default initialisation from draws in `[0, 1)`.
    pub fn initialise<T: Scalar>(&self, parameters: &mut [T], draws: &mut impl Iterator<Item = f64>) {
        self.network.initialise(parameters, draws);
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
        let [low, high] = LOG_RANGE.map(T::of);
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
        let [low, high] = LOG_RANGE.map(T::of);
        let share = T::of(1.0 / batch as f64);
        let mut loss = 0.0;
        for (sample, (&lambda, &violation)) in tape.lambda.iter().zip(violation).enumerate() {
            loss -= (lambda * violation).to_f64();
            let log = tape.network.output()[sample];
            let inside = log >= low && log <= high;
            tape.network.output_gradient()[sample] = if inside { -lambda * violation * share } else { T::zero() };
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
        let dual = Dual::new(6, 0.1);
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
        let dual = Dual::new(6, 0.1);
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

    #[test]
    fn beyond_the_clip_lambda_stays_at_its_bound() {
        let dual = Dual::new(2, 1.0);
        let mut parameters = vec![0.0; dual.size()];
        for (bias, bound) in [(-30.0, (-20f64).exp()), (9.0, 148.413_159_102_576_6)] {
            *parameters.last_mut().unwrap() = bias;
            let mut tape = dual.tape(1);
            dual.forward(&parameters, &[3.0], &mut tape);
            assert!((tape.lambda[0] / bound - 1.0).abs() < 1e-12);
        }
    }
}
