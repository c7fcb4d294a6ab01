//! Counterfactual transition weights (Eqs. 8 and 9): a recorded action that is
//! safe, but only just, counts more.

use nalgebra::DMatrix;

use super::EPSILON;
use crate::critic::{Critic, CriticTape, Pick, Task, Twins};
use crate::nn::Scalar;

/// Settings of Eqs. 8 and 9 (Table 2).
#[derive(Clone, Debug, PartialEq)]
pub struct Counterfactual {
    /// `K`, perturbed actions for each transition.
    pub perturbations: usize,
    /// `sigma`, standard deviation of a perturbation of each action entry `[A]`.
    pub sigma: Vec<f64>,
    /// `w_max`, cap of a weight.
    pub max: f64,
    /// Share of the new value in the moving average over refreshes.
    pub ema: f64,
    /// What is made of the twins of `Q_cS`.
    pub twins: Twins,
}

impl Counterfactual {
    /// The safety margins of Eq. 8 into `margin` `[B]`:
    /// `m = [max_k Q_cS(s, kappa, a^(k)) - bound]_+ [Q_cS(s, kappa, a) <= bound]`,
    /// with `a^(k) = clip(a + eps^(k), -1, 1)` and `draw(k, sample, out)` giving
    /// standard normal draws. `Q_cS` is the larger twin in the paper; its `bound` `[B]` is kappa.
    pub fn margins<T: Scalar>(
        &self,
        (critic, parameters): (&Critic, &[T]),
        (state, kappa, action): (&DMatrix<T>, &[T], &DMatrix<T>),
        bound: &[T],
        draw: &(impl Fn(usize, usize, &mut [T]) + ?Sized),
        tape: &mut CriticTape<T>,
        margin: &mut [T],
    ) {
        let mut risk = |action: &DMatrix<T>| -> Vec<T> {
            critic.forward(parameters, &[Task::ShortCost], (state, kappa, action), tape, false);
            tape.values(Task::ShortCost, Pick { twins: self.twins, second: false }).collect()
        };
        let recorded = risk(action);
        let mut worst = vec![T::of(f64::NEG_INFINITY); margin.len()];
        let mut perturbed = action.clone();
        let one = T::one();
        for k in 0..self.perturbations {
            for (sample, mut column) in perturbed.column_iter_mut().enumerate() {
                draw(k, sample, column.as_mut_slice());
                let recorded = action.column(sample);
                for ((noise, &action), &sigma) in column.iter_mut().zip(recorded.iter()).zip(&self.sigma) {
                    *noise = (action + T::of(sigma) * *noise).max(-one).min(one);
                }
            }
            for (worst, risk) in worst.iter_mut().zip(risk(&perturbed)) {
                *worst = worst.max(risk);
            }
        }
        for (((margin, &bound), recorded), worst) in margin.iter_mut().zip(bound).zip(recorded).zip(worst) {
            *margin = if recorded <= bound { (worst - bound).max(T::zero()) } else { T::zero() };
        }
    }

    /// Eq. 9 over one mini-batch, `w = min(1 + m / (E[m] + eps), w_max)`, then the
    /// moving average `w_cf <- (1 - ema) w_cf + ema w`; `rows` are the mini-batch.
    pub fn update(&self, margins: &[f32], rows: &[u32], weights: &mut [f32]) {
        let mean = rows.iter().map(|&row| f64::from(margins[row as usize])).sum::<f64>() / rows.len() as f64;
        for row in rows.iter().map(|&row| row as usize) {
            let fresh = (1.0 + f64::from(margins[row]) / (mean + EPSILON)).min(self.max);
            weights[row] = ((1.0 - self.ema) * f64::from(weights[row]) + self.ema * fresh) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::fill;

    fn settings() -> Counterfactual {
        Counterfactual { perturbations: 8, sigma: vec![0.1], max: 2.0, ema: 0.3, twins: Twins::Pessimistic }
    }

    fn margins(kappa: f64) -> Vec<f64> {
        let critic = Critic::new(2, 1, 6, 5, 1.0);
        let parameters = fill(critic.size(), 1);
        let state = DMatrix::from_vec(2, 6, fill(12, 2));
        let action = DMatrix::from_vec(1, 6, fill(6, 3));
        let mut margin = vec![f64::NAN; 6];
        let draw = |k: usize, sample: usize, out: &mut [f64]| out.fill(((k + 3 * sample) as f64).sin());
        let inputs = (&state, &[kappa; 6][..], &action);
        settings().margins((&critic, &parameters), inputs, &[kappa; 6], &draw, &mut critic.tape(6), &mut margin);
        margin
    }

    #[test]
    fn a_budget_beyond_every_risk_leaves_no_margin_and_one_below_every_risk_neither() {
        assert_eq!(margins(1e3), [0.0; 6]);
        assert_eq!(margins(-1e3), [0.0; 6]);
    }

    #[test]
    fn weights_lie_between_one_and_the_cap_and_move_by_the_average() {
        let mut weights = vec![1.0f32; 4];
        settings().update(&[0.0, 0.1, 4.0, 9.0], &[0, 1, 2], &mut weights);
        let mean = 4.1 / 3.0;
        let expected = [1.0, 1.0 + 0.3 * 0.1 / mean, 1.3, 1.0];
        for (weight, expected) in weights.iter().zip(expected) {
            assert!((f64::from(*weight) - expected).abs() < 1e-6);
        }
    }

    #[test]
    fn without_margins_weights_fall_back_towards_one() {
        let mut weights = vec![2.0f32; 2];
        settings().update(&[0.0, 0.0], &[0, 1], &mut weights);
        assert!((weights[0] - 1.7).abs() < 1e-6);
    }
}
