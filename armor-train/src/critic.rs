//! The multi-task critic (section 3.2, Eqs. 2 to 4): a trunk shared by reward,
//! long-term cost and short-term cost, and twin heads for each.
//!
//! ```text
//! h      = trunk([s; scale kappa; a])
//! Q_f,i  = head_f,i(h)                      f in {r, L, S}, i in {1, 2}
//! ```

use nalgebra::DMatrix;

use crate::nn::{Activation, Mlp, Scalar, Tape};

/// What a pair of heads estimates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// Discounted reward, `Q_r`.
    Reward,
    /// Long-term cost, `Q_cL`.
    LongCost,
    /// Short-term cost, `Q_cS`.
    ShortCost,
}

impl Task {
    /// All tasks, in the order of their heads.
    pub const ALL: [Self; 3] = [Self::Reward, Self::LongCost, Self::ShortCost];

    /// Whether the twin `a` is the more pessimistic one: the smaller reward, the larger cost.
    fn is_worse<T: Scalar>(self, a: T, b: T) -> bool {
        match self {
            Self::Reward => a <= b,
            Self::LongCost | Self::ShortCost => a >= b,
        }
    }
}

/// Layout of the critic within its parameters: trunk, then heads `r1 r2 L1 L2 S1 S2`.
#[derive(Clone, Debug)]
pub struct Critic {
    state: usize,
    action: usize,
    kappa_scale: f64,
    trunk: Mlp,
    heads: [[Mlp; 2]; 3],
}

/// What a forward pass leaves behind; reused from step to step.
#[derive(Clone, Debug)]
pub struct CriticTape<T: Scalar> {
    input: DMatrix<T>,
    trunk: Tape<T>,
    heads: [[Tape<T>; 2]; 3],
    /// Gradient with respect to the trunk's output from one head.
    from_head: DMatrix<T>,
    /// Gradient with respect to the input.
    input_gradient: DMatrix<T>,
}

impl Critic {
    /// A trunk of two layers of `trunk` units and heads of one hidden layer of `head` units;
    /// the networks see `kappa_scale * kappa`.
    pub fn new(state: usize, action: usize, trunk: usize, head: usize, kappa_scale: f64) -> Self {
        let shared = Mlp::new(&[state + 1 + action, trunk, trunk], 0, Activation::Mish, true);
        let mut end = shared.end();
        let heads = [(); 3].map(|()| {
            [(); 2].map(|()| {
                let mlp = Mlp::new(&[trunk, head, 1], end, Activation::Mish, false);
                end = mlp.end();
                mlp
            })
        });
        Self { state, action, kappa_scale, trunk: shared, heads }
    }

    /// Numbers of the network.
    pub fn size(&self) -> usize {
        self.heads[2][1].end()
    }

    /// Numbers of the shared trunk, which come first.
    pub fn trunk_size(&self) -> usize {
        self.trunk.end()
    }

    /// PyTorch's default initialisation from draws in `[0, 1)`.
    pub fn initialise<T: Scalar>(&self, parameters: &mut [T], draws: &mut impl Iterator<Item = f64>) {
        self.trunk.initialise(parameters, draws);
        for head in self.heads.iter().flatten() {
            head.initialise(parameters, draws);
        }
    }

    /// Room for passes over `samples` columns.
    pub fn tape<T: Scalar>(&self, samples: usize) -> CriticTape<T> {
        let inputs = self.state + 1 + self.action;
        let trunk = self.trunk.tape(samples);
        CriticTape {
            input: DMatrix::zeros(inputs, samples),
            from_head: DMatrix::zeros(trunk.output().nrows(), samples),
            trunk,
            heads: self.heads.each_ref().map(|twins| twins.each_ref().map(|head| head.tape(samples))),
            input_gradient: DMatrix::zeros(inputs, samples),
        }
    }

    /// Runs the heads of `tasks` on `(s, kappa, a)`; with `slopes`, a backward pass may follow.
    pub fn forward<T: Scalar>(
        &self,
        parameters: &[T],
        tasks: &[Task],
        (state, kappa, action): (&DMatrix<T>, &[T], &DMatrix<T>),
        tape: &mut CriticTape<T>,
        slopes: bool,
    ) {
        let scale = T::of(self.kappa_scale);
        tape.input.rows_mut(0, self.state).copy_from(state);
        for (input, &kappa) in tape.input.row_mut(self.state).iter_mut().zip(kappa) {
            *input = scale * kappa;
        }
        tape.input.rows_mut(self.state + 1, self.action).copy_from(action);
        self.trunk.forward(parameters, &tape.input, &mut tape.trunk, slopes);
        for &task in tasks {
            for (head, head_tape) in self.heads[task as usize].iter().zip(&mut tape.heads[task as usize]) {
                head.forward(parameters, tape.trunk.output(), head_tape, slopes);
            }
        }
    }

    /// The gradient of the task's losses (Eq. 4) from the last forward pass.
    ///
    /// Head gradients are added to `gradient`, as long as the parameters; the
    /// trunk's gradient is written to `trunk_gradient`. Returns the summed loss
    /// `sum_b sum_i (Q_i - y)^2`; gradients are those of the sum divided by `batch`.
    pub fn backward_td<T: Scalar>(
        &self,
        parameters: &[T],
        task: Task,
        target: &[T],
        batch: usize,
        tape: &mut CriticTape<T>,
        (gradient, trunk_gradient): (&mut [T], &mut [T]),
    ) -> f64 {
        let scale = T::of(2.0 / batch as f64);
        let mut loss = 0.0;
        for (index, head) in self.heads[task as usize].iter().enumerate() {
            let head_tape = &mut tape.heads[task as usize][index];
            for (sample, &target) in target.iter().enumerate() {
                let error = head_tape.output()[sample] - target;
                loss += error.to_f64().powi(2);
                head_tape.output_gradient()[sample] = scale * error;
            }
            let hidden = tape.trunk.output();
            head.backward(parameters, hidden, head_tape, Some(gradient), Some(&mut tape.from_head));
            add_head(&mut tape.trunk, &tape.from_head, index == 0);
        }
        self.trunk.backward(parameters, &tape.input, &mut tape.trunk, Some(trunk_gradient), None);
        loss
    }

    /// The gradient of `sum_b sum_f slope_f,b Q_f(s, kappa, a)_b` with respect to the
    /// action, `A x B`, where `Q_f` is the pessimistic twin of the last forward pass.
    pub fn action_gradient<T: Scalar>(
        &self,
        parameters: &[T],
        slopes: &[(Task, &[T])],
        tape: &mut CriticTape<T>,
        action_gradient: &mut DMatrix<T>,
    ) {
        let mut is_first = true;
        for &(task, slope) in slopes {
            let [one, two] = &mut tape.heads[task as usize];
            for (sample, &slope) in slope.iter().enumerate() {
                let first_is_worse = task.is_worse(one.output()[sample], two.output()[sample]);
                one.output_gradient()[sample] = if first_is_worse { slope } else { T::zero() };
                two.output_gradient()[sample] = if first_is_worse { T::zero() } else { slope };
            }
            for (head, head_tape) in self.heads[task as usize].iter().zip([one, two]) {
                head.backward(parameters, tape.trunk.output(), head_tape, None, Some(&mut tape.from_head));
                add_head(&mut tape.trunk, &tape.from_head, is_first);
                is_first = false;
            }
        }
        let input_gradient = &mut tape.input_gradient;
        self.trunk.backward(parameters, &tape.input, &mut tape.trunk, None, Some(input_gradient));
        action_gradient.copy_from(&input_gradient.rows(self.state + 1, self.action));
    }
}

impl<T: Scalar> CriticTape<T> {
    /// The pessimistic twin of a task from the last forward pass: the minimum
    /// of rewards, the maximum of costs.
    pub fn pessimistic(&self, task: Task) -> impl Iterator<Item = T> {
        let [one, two] = &self.heads[task as usize];
        let twins = one.output().iter().zip(two.output().iter());
        twins.map(move |(&one, &two)| if task.is_worse(one, two) { one } else { two })
    }
}

/// Adds the gradient that came through one head to the trunk's output gradient; the first overwrites.
fn add_head<T: Scalar>(trunk: &mut Tape<T>, from_head: &DMatrix<T>, is_first: bool) {
    if is_first {
        trunk.output_gradient().copy_from(from_head);
    } else {
        *trunk.output_gradient() += from_head;
    }
}

/// The Bellman targets of one task (Eq. 3): `y = signal + discount * alive * Q^-`,
/// where `Q^-` is the pessimistic twin of the target critic at the next action.
pub fn bellman_target<T: Scalar>(
    signal: &[T],
    alive: &[T],
    discount: f64,
    next_value: impl Iterator<Item = T>,
    out: &mut Vec<T>,
) {
    let discount = T::of(discount);
    out.clear();
    out.extend(
        signal.iter().zip(alive).zip(next_value).map(|((&signal, &alive), next)| signal + discount * alive * next),
    );
}

#[cfg(test)]
mod tests {
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

    fn fixture() -> Fixture {
        let critic = Critic::new(3, 2, 6, 5, 0.5);
        Fixture {
            parameters: fill(critic.size(), 1),
            state: DMatrix::from_vec(3, SAMPLES, fill(3 * SAMPLES, 2)),
            kappa: vec![0.0, 1.0, 2.0, 3.0, 0.5],
            action: DMatrix::from_vec(2, SAMPLES, fill(2 * SAMPLES, 3)),
            target: fill(SAMPLES, 4),
            critic,
        }
    }

    #[test]
    fn td_gradients_are_those_of_finite_differences() {
        let f = fixture();
        for task in Task::ALL {
            let mut tape = f.critic.tape(SAMPLES);
            let mut gradient = vec![0.0; f.critic.size()];
            let mut trunk = vec![0.0; f.critic.trunk_size()];
            f.critic.forward(&f.parameters, &[task], (&f.state, &f.kappa, &f.action), &mut tape, true);
            f.critic.backward_td(&f.parameters, task, &f.target, SAMPLES, &mut tape, (&mut gradient, &mut trunk));
            gradient[..trunk.len()].copy_from_slice(&trunk);
            assert_gradient(&f.parameters, &gradient, |parameters| {
                let mut tape = f.critic.tape(SAMPLES);
                f.critic.forward(parameters, &[task], (&f.state, &f.kappa, &f.action), &mut tape, true);
                let unused = (&mut gradient.clone()[..], &mut trunk.clone()[..]);
                f.critic.backward_td(parameters, task, &f.target, SAMPLES, &mut tape, unused) / SAMPLES as f64
            });
        }
    }

    #[test]
    fn action_gradients_are_those_of_finite_differences() {
        let f = fixture();
        let (reward_slope, cost_slope) = (fill(SAMPLES, 5), fill(SAMPLES, 6));
        let tasks = [Task::Reward, Task::LongCost];
        let mut tape = f.critic.tape(SAMPLES);
        let mut gradient = DMatrix::zeros(2, SAMPLES);
        f.critic.forward(&f.parameters, &tasks, (&f.state, &f.kappa, &f.action), &mut tape, true);
        let slopes = [(Task::Reward, &reward_slope[..]), (Task::LongCost, &cost_slope[..])];
        f.critic.action_gradient(&f.parameters, &slopes, &mut tape, &mut gradient);
        assert_gradient(f.action.as_slice(), gradient.as_slice(), |action| {
            let action = DMatrix::from_column_slice(2, SAMPLES, action);
            let mut tape = f.critic.tape(SAMPLES);
            f.critic.forward(&f.parameters, &tasks, (&f.state, &f.kappa, &action), &mut tape, false);
            let sum = |task, slope: &[f64]| tape.pessimistic(task).zip(slope).map(|(q, s)| q * s).sum::<f64>();
            sum(Task::Reward, &reward_slope) + sum(Task::LongCost, &cost_slope)
        });
    }

    #[test]
    fn pessimism_is_the_minimum_of_rewards_and_the_maximum_of_costs() {
        let f = fixture();
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
}
