//! The multi-task critic (section 3.2, Eqs. 2 to 4): a trunk shared by reward,
//! long-term cost and short-term cost, and twin heads for each.
//!
//! ```text
//! h      = trunk([s; scale kappa; a])
//! Q_f,i  = head_f,i(h)                      f in {r, L, S}, i in {1, 2}
//! ```
//!
//! [`CriticOptions`] has the layouts of the paper's ablation.

mod options;

pub mod bootstrap;
mod expectile;
mod tape;
mod task;
mod twins;
pub mod value;

use nalgebra::DMatrix;

use crate::nn::{Activation, Mlp, Panels, Passes, Scalar, Update, Weights};

pub use options::{CostHeads, CostOutput, CriticOptions, Trunk, TwinLoss};
pub use tape::CriticTape;
pub use task::Task;
pub use twins::{Pick, Twins};

/// Layout of the critic within its parameters: trunks, then heads `r1 r2 L1 L2 S1 S2`.
#[derive(Clone, Debug)]
pub struct Critic {
    state: usize,
    action: usize,
    kappa_scale: f64,
    options: CriticOptions,
    /// One, or one for each pair of heads.
    trunks: Vec<Mlp>,
    /// The twins of each estimate.
    heads: Vec<[Mlp; 2]>,
}

impl Critic {
    /// The paper's critic: a trunk of two layers of `trunk` units and heads of one
    /// hidden layer of `head` units; the networks see `kappa_scale * kappa`.
    pub fn new(state: usize, action: usize, trunk: usize, head: usize, kappa_scale: f64) -> Self {
        Self::with_options(CriticOptions::default(), [state, action, trunk, head], kappa_scale)
    }

    /// As [`Critic::new`], for the widths `[state, action, trunk, head]` and another layout.
    pub fn with_options(options: CriticOptions, widths: [usize; 4], kappa_scale: f64) -> Self {
        let [state, action, trunk, head] = widths;
        let mut end = 0;
        let mut stack = |widths: &[usize], output| {
            let mlp = Mlp::new(widths, end, Activation::Mish, output);
            end = mlp.end();
            mlp
        };
        let trunks =
            (0..options.trunks()).map(|_| stack(&[state + 1 + action, trunk, trunk], Some(Activation::Mish))).collect();
        let hidden = [[trunk].as_slice(), &vec![head; options.head_layers], &[1]].concat();
        let heads = (0..options.heads()).map(|index| [(); 2].map(|()| stack(&hidden, options.output(index)))).collect();
        Self { state, action, kappa_scale, options, trunks, heads }
    }

    /// The factor on kappa.
    pub const fn kappa_scale(&self) -> f64 {
        self.kappa_scale
    }

    /// The numbers of the trunk and of the heads of reward and long-term cost, layer by layer;
    /// none for a layout that a policy image cannot hold.
    pub fn deployed<'a>(&self, parameters: &'a [f32]) -> Option<&'a [f32]> {
        let CriticOptions { trunk, head_layers, cost_output, .. } = self.options;
        let fits = trunk == Trunk::Shared && head_layers == 1 && cost_output == CostOutput::Linear;
        let [_, last] = self.heads.get(Task::LongCost as usize).filter(|_| fits)?;
        parameters.get(..last.end())
    }

    /// Numbers of the network.
    pub fn size(&self) -> usize {
        self.heads.last().map_or(0, |[_, last]| last.end())
    }

    /// Numbers of the trunks, which come first.
    pub fn trunk_size(&self) -> usize {
        self.trunks.last().map_or(0, Mlp::end)
    }

    /// PyTorch's default initialisation from draws in `[0, 1)`.
    pub fn initialise<T: Scalar>(&self, parameters: &mut [T], draws: &mut impl Iterator<Item = f64>) {
        for network in self.trunks.iter().chain(self.heads.iter().flatten()) {
            network.initialise(parameters, draws);
        }
    }

    /// Room for passes over `samples` columns.
    pub fn tape<T: Scalar>(&self, samples: usize) -> CriticTape<T> {
        let inputs = self.state + 1 + self.action;
        // One forward pass serves all tasks, each of which goes back on its own.
        let is_shared = |network_of: fn(&CriticOptions, Task) -> usize, index| {
            Task::ALL.into_iter().filter(|&task| network_of(&self.options, task) == index).count() > 1
        };
        let tape = |network: &Mlp, is_shared| match network.tape(samples) {
            tape if is_shared => tape.repeatable(),
            tape => tape,
        };
        let trunks = self.trunks.iter().enumerate();
        let heads = self.heads.iter().enumerate();
        CriticTape {
            options: self.options,
            input: DMatrix::zeros(inputs, samples),
            trunks: trunks.map(|(index, trunk)| tape(trunk, is_shared(CriticOptions::trunk_of, index))).collect(),
            heads: heads
                .map(|(pair, twins)| twins.each_ref().map(|head| tape(head, is_shared(CriticOptions::head_of, pair))))
                .collect(),
            input_gradient: DMatrix::zeros(inputs, samples),
        }
    }

    /// The parameters, with copies of all weights for many passes.
    pub fn pack<'a, T: Scalar>(&self, parameters: &'a [T], passes: Passes) -> Panels<'a, T> {
        let layers = self.trunks.iter().chain(self.heads.iter().flatten()).flat_map(Mlp::layers);
        Panels::new(layers, parameters, passes)
    }

    /// Runs the heads of `tasks` on `(s, kappa, a)`; with `slopes`, a backward pass may follow.
    pub fn forward<'a, T: Scalar>(
        &self,
        weights: impl Into<Weights<'a, T>>,
        tasks: &[Task],
        (state, kappa, action): (&DMatrix<T>, &[T], &DMatrix<T>),
        tape: &mut CriticTape<T>,
        slopes: bool,
    ) {
        let weights = weights.into();
        let scale = T::of(self.kappa_scale);
        tape.input.rows_mut(0, self.state).copy_from(state);
        for (input, &kappa) in tape.input.row_mut(self.state).iter_mut().zip(kappa) {
            *input = scale * kappa;
        }
        tape.input.rows_mut(self.state + 1, self.action).copy_from(action);
        for (index, (trunk, trunk_tape)) in self.trunks.iter().zip(&mut tape.trunks).enumerate() {
            if tasks.iter().any(|&task| self.options.trunk_of(task) == index) {
                trunk.forward(weights, &tape.input, trunk_tape, slopes);
            }
        }
        for &task in tasks {
            let (index, hidden) = (self.options.head_of(task), tape.trunks[self.options.trunk_of(task)].output());
            for (head, head_tape) in self.heads[index].iter().zip(&mut tape.heads[index]) {
                head.forward(weights, hidden, head_tape, slopes);
            }
        }
    }

    /// The gradient of the task's losses (Eq. 4) from the last forward pass.
    ///
    /// Head gradients are added to `gradient`, as long as the parameters; the
    /// gradient of the task's trunk is added to `trunk_gradient`. Returns the summed
    /// loss `sum_b sum_i (Q_i - y)^2`; gradients are those of the sum divided by `batch`.
    pub fn backward_td<'a, T: Scalar>(
        &self,
        weights: impl Into<Weights<'a, T>>,
        task: Task,
        target: &[T],
        batch: usize,
        tape: &mut CriticTape<T>,
        (gradient, trunk_gradient): (&mut [T], &mut [T]),
    ) -> f64 {
        let weights = weights.into();
        let twin_share = self.options.twin_loss.share();
        let scale = T::of(2.0 * twin_share / batch as f64);
        let (pair, trunk) = (self.options.head_of(task), self.options.trunk_of(task));
        let trunk_tape = &mut tape.trunks[trunk];
        let mut loss = 0.0;
        for (index, head) in self.heads[pair].iter().enumerate() {
            let head_tape = &mut tape.heads[pair][index];
            for (sample, &target) in target.iter().enumerate() {
                let error = head_tape.output()[sample] - target;
                loss += twin_share * error.to_f64().powi(2);
                head_tape.output_gradient()[sample] = scale * error;
            }
            let (hidden, hidden_gradient) = trunk_tape.output_with_gradient();
            let update = if index == 0 { Update::Replace } else { Update::Add };
            head.backward(weights, hidden, head_tape, Some(gradient), Some((hidden_gradient, update)));
        }
        self.trunks[trunk].backward(weights, &tape.input, trunk_tape, Some(trunk_gradient), None);
        loss
    }

    /// The gradient of `sum_b sum_f slope_f,b Q_f(s, kappa, a)_b` with respect to the
    /// action, `A x B`, where `Q_f` is what `pick` makes of the twins of the last forward pass.
    pub fn action_gradient<'a, T: Scalar>(
        &self,
        weights: impl Into<Weights<'a, T>>,
        (slopes, pick): (&[(Task, &[T])], Pick),
        tape: &mut CriticTape<T>,
        action_gradient: &mut DMatrix<T>,
    ) {
        let weights = weights.into();
        let mut is_met = vec![false; self.trunks.len()];
        for &(task, slope) in slopes {
            let (pair, trunk) = (self.options.head_of(task), self.options.trunk_of(task));
            let [one, two] = &mut tape.heads[pair];
            for (sample, &slope) in slope.iter().enumerate() {
                let [of_one, of_two] = pick.weights(task, [one.output()[sample], two.output()[sample]]);
                one.output_gradient()[sample] = of_one * slope;
                two.output_gradient()[sample] = of_two * slope;
            }
            for (head, head_tape) in self.heads[pair].iter().zip([one, two]) {
                let (hidden, hidden_gradient) = tape.trunks[trunk].output_with_gradient();
                let update = if is_met[trunk] { Update::Add } else { Update::Replace };
                head.backward(weights, hidden, head_tape, None, Some((hidden_gradient, update)));
                is_met[trunk] = true;
            }
        }
        action_gradient.fill(T::zero());
        let trunks = self.trunks.iter().zip(&mut tape.trunks).zip(is_met);
        for ((trunk, trunk_tape), _) in trunks.filter(|(_, is_met)| *is_met) {
            let below = (&mut tape.input_gradient, Update::Replace);
            trunk.backward(weights, &tape.input, trunk_tape, None, Some(below));
            *action_gradient += tape.input_gradient.rows(self.state + 1, self.action);
        }
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
mod tests;
