//! Gradients of the critic by finite differences, in f64.

use super::*;
use crate::testing::{assert_gradient, fill};

const SAMPLES: usize = 5;

struct Fixture {
    critic: Critic,
    parameters: Vec<f64>,
    state: DMatrix<f64>,
    kappa: Vec<f64>,
    action: DMatrix<f64>,
    target: Vec<f64>,
}

const PAPER: CriticOptions = CriticOptions {
    trunk: Trunk::Shared,
    cost_heads: CostHeads::PerHorizon,
    head_layers: 1,
    cost_output: CostOutput::Linear,
    twin_loss: TwinLoss::Sum,
};

/// Layouts in which every option takes each of its values.
const LAYOUTS: [CriticOptions; 5] = [
    PAPER,
    CriticOptions { trunk: Trunk::Separate, ..PAPER },
    CriticOptions { cost_heads: CostHeads::Single, head_layers: 2, ..PAPER },
    CriticOptions { cost_output: CostOutput::Softplus, twin_loss: TwinLoss::Mean, ..PAPER },
    CriticOptions { trunk: Trunk::Separate, cost_heads: CostHeads::Single, ..PAPER },
];

fn fixture(options: CriticOptions) -> Fixture {
    let critic = Critic::with_options(options, [3, 2, 6, 5], 0.5);
    Fixture {
        parameters: fill(critic.size(), 1),
        state: DMatrix::from_vec(3, SAMPLES, fill(3 * SAMPLES, 2)),
        kappa: vec![0.0, 1.0, 2.0, 3.0, 0.5],
        action: DMatrix::from_vec(2, SAMPLES, fill(2 * SAMPLES, 3)),
        target: fill(SAMPLES, 4),
        critic,
    }
}

impl Fixture {
    fn values(&self, task: Task) -> Vec<f64> {
        let mut tape = self.critic.tape(SAMPLES);
        self.critic.forward(&self.parameters, &[task], (&self.state, &self.kappa, &self.action), &mut tape, false);
        tape.pessimistic(task).collect()
    }

    /// The gradient of a task's loss, as long as the parameters, and the loss over the batch.
    fn td(&self, task: Task, parameters: &[f64]) -> (Vec<f64>, f64) {
        let mut tape = self.critic.tape(SAMPLES);
        let mut gradient = vec![0.0; self.critic.size()];
        let mut trunk = vec![0.0; self.critic.trunk_size()];
        self.critic.forward(parameters, &[task], (&self.state, &self.kappa, &self.action), &mut tape, true);
        let gradients = (&mut gradient[..], &mut trunk[..]);
        let loss = self.critic.backward_td(parameters, task, &self.target, SAMPLES, &mut tape, gradients);
        gradient[..trunk.len()].copy_from_slice(&trunk);
        (gradient, loss / SAMPLES as f64)
    }
}

#[test]
fn td_gradients_are_those_of_finite_differences_in_every_layout() {
    for f in LAYOUTS.map(fixture) {
        for task in Task::ALL {
            let (gradient, _) = f.td(task, &f.parameters);
            assert_gradient(&f.parameters, &gradient, |parameters| f.td(task, parameters).1);
        }
    }
}

#[test]
fn one_forward_pass_serves_the_gradients_of_all_tasks_in_every_layout() {
    for f in LAYOUTS.map(fixture) {
        let mut tape = f.critic.tape(SAMPLES);
        f.critic.forward(&f.parameters, &Task::ALL, (&f.state, &f.kappa, &f.action), &mut tape, true);
        for task in Task::ALL {
            let (mut gradient, mut trunk) = (vec![0.0; f.critic.size()], vec![0.0; f.critic.trunk_size()]);
            let gradients = (&mut gradient[..], &mut trunk[..]);
            f.critic.backward_td(&f.parameters, task, &f.target, SAMPLES, &mut tape, gradients);
            gradient[..trunk.len()].copy_from_slice(&trunk);
            assert_eq!(gradient, f.td(task, &f.parameters).0, "{task:?} of {:?}", f.critic.options);
        }
    }
}

#[test]
fn action_gradients_are_those_of_finite_differences_in_every_layout() {
    let picks = [Twins::Pessimistic, Twins::Minimum, Twins::Mean, Twins::Random, Twins::Random];
    for (f, (index, twins)) in LAYOUTS.map(fixture).into_iter().zip(picks.into_iter().enumerate()) {
        let pick = Pick { twins, second: index == 4 };
        let (reward_slope, cost_slope) = (fill(SAMPLES, 5), fill(SAMPLES, 6));
        let tasks = [Task::Reward, Task::LongCost];
        let mut tape = f.critic.tape(SAMPLES);
        let mut gradient = DMatrix::zeros(2, SAMPLES);
        f.critic.forward(&f.parameters, &tasks, (&f.state, &f.kappa, &f.action), &mut tape, true);
        let slopes = [(Task::Reward, &reward_slope[..]), (Task::LongCost, &cost_slope[..])];
        f.critic.action_gradient(&f.parameters, (&slopes, pick), &mut tape, &mut gradient);
        assert_gradient(f.action.as_slice(), gradient.as_slice(), |action| {
            let action = DMatrix::from_column_slice(2, SAMPLES, action);
            let mut tape = f.critic.tape(SAMPLES);
            f.critic.forward(&f.parameters, &tasks, (&f.state, &f.kappa, &action), &mut tape, false);
            let sum = |task, slope: &[f64]| tape.values(task, pick).zip(slope).map(|(q, s)| q * s).sum::<f64>();
            sum(Task::Reward, &reward_slope) + sum(Task::LongCost, &cost_slope)
        });
    }
}

#[test]
fn only_a_shared_trunk_learns_from_every_task() {
    for (trunk, shares) in [(Trunk::Shared, true), (Trunk::Separate, false)] {
        let f = fixture(CriticOptions { trunk, ..PAPER });
        let touched = Task::ALL.map(|task| f.td(task, &f.parameters).0.iter().map(|g| *g != 0.0).collect::<Vec<_>>());
        let [reward, long_cost, short_cost] = &touched;
        for (a, b) in [(reward, long_cost), (reward, short_cost), (long_cost, short_cost)] {
            assert_eq!(a.iter().zip(b).any(|(a, b)| a & b), shares, "{trunk:?}");
        }
    }
}

#[test]
fn a_single_cost_head_answers_for_both_horizons() {
    let single = fixture(CriticOptions { cost_heads: CostHeads::Single, ..PAPER });
    assert_eq!(single.values(Task::LongCost), single.values(Task::ShortCost));
    assert_ne!(single.values(Task::LongCost), single.values(Task::Reward));
    assert_ne!(fixture(PAPER).values(Task::LongCost), fixture(PAPER).values(Task::ShortCost));
}

#[test]
fn softplus_keeps_costs_above_zero_and_leaves_rewards_alone() {
    let softplus = fixture(CriticOptions { cost_output: CostOutput::Softplus, ..PAPER });
    let linear = [Task::LongCost, Task::ShortCost].map(|task| (task, fixture(PAPER).values(task)));
    assert!(linear.iter().any(|(_, values)| values.iter().any(|value| *value < 0.0)));
    for (task, linear) in linear {
        for (value, linear) in softplus.values(task).into_iter().zip(linear) {
            assert!((value - linear.exp().ln_1p()).abs() < 1e-12);
        }
    }
    assert_eq!(softplus.values(Task::Reward), fixture(PAPER).values(Task::Reward));
}

#[test]
fn the_mean_of_twin_losses_is_half_their_sum() {
    let sum = fixture(PAPER);
    let mean = fixture(CriticOptions { twin_loss: TwinLoss::Mean, ..PAPER });
    let ((gradient, loss), (half_gradient, half_loss)) =
        (sum.td(Task::Reward, &sum.parameters), mean.td(Task::Reward, &mean.parameters));
    assert!((loss - 2.0 * half_loss).abs() < 1e-12);
    assert!(gradient.iter().zip(half_gradient).all(|(whole, half)| (whole - 2.0 * half).abs() < 1e-12));
}

#[test]
fn pessimism_is_the_minimum_of_rewards_and_the_maximum_of_costs() {
    let f = fixture(PAPER);
    let mut tape = f.critic.tape(SAMPLES);
    f.critic.forward(&f.parameters, &Task::ALL, (&f.state, &f.kappa, &f.action), &mut tape, false);
    for (task, choose) in Task::ALL.into_iter().zip([f64::min, f64::max, f64::max]) {
        let [one, two] = &tape.heads[task as usize];
        let expected: Vec<f64> = one.output().zip_map(two.output(), choose).iter().copied().collect();
        assert_eq!(tape.pessimistic(task).collect::<Vec<_>>(), expected);
        assert_ne!(one.output(), two.output());
    }
}

#[test]
fn targets_bootstrap_only_where_the_episode_goes_on() {
    let mut target = Vec::new();
    bellman_target(&[1.0, 2.0], &[1.0, 0.0], 0.5, [10.0, 10.0].into_iter(), &mut target);
    assert_eq!(target, [6.0, 2.0]);
}
