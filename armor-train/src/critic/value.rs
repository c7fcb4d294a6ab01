//! State values beside the critic, for targets that ask no action that the data lacks
//! (implicit Q-learning, Kostrikov et al. 2022).
//!
//! ```text
//! L_V = mean_b |tau_f - [u < 0]| u^2          u = Q^-_f(s, kappa, a) - V_f(s, kappa)
//! y_f = signal + gamma_f alive V_f(s', kappa')           in place of Eq. 3
//! ```
//!
//! `Q^-` is the pessimistic twin of the target critic at the recorded action.
//! Each task has a network of its own: where nothing is shared, nothing
//! conflicts, and gradient surgery (Eq. 5) stays with the critic's trunk.

use nalgebra::DMatrix;

use super::Task;
use super::expectile::expectile_loss;
use crate::nn::{Activation, Mlp, Panels, Passes, Scalar, Tape, Weights};

/// Layout of the three state-value networks within their parameters, in the order of [`Task::ALL`].
#[derive(Clone, Debug)]
pub struct StateValue {
    state: usize,
    kappa_scale: f64,
    networks: [Mlp; 3],
    /// `tau` of each task, within 0 and 1.
    expectiles: [f64; 3],
}

/// What a forward pass leaves behind.
#[derive(Clone, Debug)]
pub struct StateValueTape<T: Scalar> {
    input: DMatrix<T>,
    networks: [Tape<T>; 3],
}

impl StateValue {
    /// Two hidden layers of `hidden` units; the networks see `kappa_scale * kappa`.
    pub fn new(state: usize, hidden: usize, kappa_scale: f64, expectiles: [f64; 3]) -> Self {
        let mut end = 0;
        let networks = [(); 3].map(|()| {
            let mlp = Mlp::new(&[state + 1, hidden, hidden, 1], end, Activation::Mish, None);
            end = mlp.end();
            mlp
        });
        Self { state, kappa_scale, networks, expectiles }
    }

    /// Numbers of the networks.
    pub fn size(&self) -> usize {
        self.networks[2].end()
    }

    /// PyTorch's default initialisation from draws in `[0, 1)`.
    pub fn initialise<T: Scalar>(&self, parameters: &mut [T], draws: &mut impl Iterator<Item = f64>) {
        for network in &self.networks {
            network.initialise(parameters, draws);
        }
    }

    /// The parameters, with copies of all weights for many passes.
    pub fn pack<'a, T: Scalar>(&self, parameters: &'a [T], passes: Passes) -> Panels<'a, T> {
        Panels::new(self.networks.iter().flat_map(Mlp::layers), parameters, passes)
    }

    /// Room for passes over `samples` columns.
    pub fn tape<T: Scalar>(&self, samples: usize) -> StateValueTape<T> {
        StateValueTape {
            input: DMatrix::zeros(self.state + 1, samples),
            networks: self.networks.each_ref().map(|network| network.tape(samples)),
        }
    }

    /// Computes the values of `tasks` at `(s, kappa)`; with `slopes`, a backward pass may follow.
    pub fn forward<'a, T: Scalar>(
        &self,
        weights: impl Into<Weights<'a, T>>,
        tasks: &[Task],
        (state, kappa): (&DMatrix<T>, &[T]),
        tape: &mut StateValueTape<T>,
        slopes: bool,
    ) {
        let weights = weights.into();
        let scale = T::of(self.kappa_scale);
        tape.input.rows_mut(0, self.state).copy_from(state);
        for (input, &kappa) in tape.input.row_mut(self.state).iter_mut().zip(kappa) {
            *input = scale * kappa;
        }
        for &task in tasks {
            let index = task as usize;
            self.networks[index].forward(weights, &tape.input, &mut tape.networks[index], slopes);
        }
    }

    /// Adds the gradient of a task's expectile loss towards `target` `[B]` to `gradient`, as long as
    /// the parameters, from the last forward pass.
    ///
    /// Returns the summed loss; the gradient is that of the sum divided by `batch`.
    pub fn backward<'a, T: Scalar>(
        &self,
        weights: impl Into<Weights<'a, T>>,
        task: Task,
        target: impl Iterator<Item = T>,
        batch: usize,
        tape: &mut StateValueTape<T>,
        gradient: &mut [T],
    ) -> f64 {
        let index = task as usize;
        let (network, tape_of) = (&self.networks[index], &mut tape.networks[index]);
        let share = T::of(1.0 / batch as f64);
        let mut sum = 0.0;
        for (sample, target) in target.enumerate() {
            let (loss, slope) = expectile_loss(self.expectiles[index], target - tape_of.output()[sample]);
            sum += loss.to_f64();
            tape_of.output_gradient()[sample] = -slope * share;
        }
        network.backward(weights, &tape.input, tape_of, Some(gradient), None);
        sum
    }
}

impl<T: Scalar> StateValueTape<T> {
    /// The values of a task from the last forward pass.
    pub fn values(&self, task: Task) -> impl Iterator<Item = T> {
        self.networks[task as usize].output().iter().copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_gradient, fill};

    const SAMPLES: usize = 5;
    const KAPPA: [f64; SAMPLES] = [0.0, 1.0, 2.0, 3.0, 0.5];

    #[test]
    fn the_gradient_is_that_of_finite_differences() {
        let value = StateValue::new(3, 6, 0.5, [0.7, 0.5, 0.2]);
        let parameters = fill(value.size(), 1);
        let state = DMatrix::from_vec(3, SAMPLES, fill(3 * SAMPLES, 2));
        for task in Task::ALL {
            let mut tape = value.tape(SAMPLES);
            value.forward(&parameters, &[task], (&state, &KAPPA), &mut tape, false);
            // Errors of both signs.
            let target: Vec<f64> = tape.values(task).zip([0.3, -0.2, 0.5, -0.4, 0.1]).map(|(v, u)| v + u).collect();
            let run = |parameters: &[f64]| {
                let mut tape = value.tape(SAMPLES);
                let mut gradient = vec![0.0; value.size()];
                value.forward(parameters, &Task::ALL, (&state, &KAPPA), &mut tape, true);
                let targets = target.iter().copied();
                let loss = value.backward(parameters, task, targets, SAMPLES, &mut tape, &mut gradient);
                (loss / SAMPLES as f64, gradient)
            };
            let (loss, gradient) = run(&parameters);
            let tau = value.expectiles[task as usize];
            let expected = tau * (0.09 + 0.25 + 0.01) + (1.0 - tau) * (0.04 + 0.16);
            assert!((loss - expected / SAMPLES as f64).abs() < 1e-12);
            assert_gradient(&parameters, &gradient, |parameters| run(parameters).0);
        }
    }
}
