//! How much better than its state's value each recorded action is.
//!
//! ```text
//! A_f = Q^-_f(s, kappa, a) - V_f(s, kappa)          f in {r, cL}
//! ```

use rayon::prelude::*;

use crate::batch::Batch;
use crate::critic::value::StateValue;
use crate::critic::{Critic, Task};
use crate::extraction::trace::Trace;
use crate::learner::SHARE;
use crate::nn::Scalar;
use crate::source::Source;

/// The tasks whose advantages count.
const TASKS: [Task; 2] = [Task::Reward, Task::LongCost];

/// The critics whose opinion counts, and their parameters.
#[derive(Clone, Copy)]
pub(crate) struct Judges<'a, T: Scalar> {
    /// The target critic.
    pub(crate) critic: (&'a Critic, &'a [T]),
    /// The state values.
    pub(crate) value: (&'a StateValue, &'a [T]),
}

/// The advantages of all recorded actions at their recorded budgets, by frozen critics.
///
/// Each of reward and long-term cost is divided by its scale, the mean absolute
/// advantage of the data, so that temperature and lambda mean the same whatever
/// the units of reward and cost are. A root mean square would be ruled by the
/// few transitions whose cost is decided at once, and leave the others no weight.
#[derive(Clone, Debug, PartialEq)]
pub struct Advantages {
    /// `A_r / s_r` and `A_cL / s_cL` of each transition.
    pub scaled: Vec<[f32; 2]>,
    /// `s_r` in units of scaled reward, `s_cL` in units of scaled cost.
    pub scales: [f64; 2],
}

impl Advantages {
    /// The advantages of all transitions, by the critics alone, or along a trace of each task.
    pub(crate) fn new<T: Scalar>(source: &Source<'_>, judges: Judges<'_, T>, traces: Option<[Trace; 2]>) -> Self {
        let mut raw = vec![[0.0; 2]; source.data().len()];
        raw.par_chunks_mut(SHARE).enumerate().for_each(|(share, raw)| {
            let mut batch: Batch<T> = source.room(raw.len());
            for sample in 0..raw.len() {
                source.fill(&mut batch, sample, share * SHARE + sample, 0.0);
            }
            match traces {
                None => judges.judge(&batch, raw),
                Some(traces) => judges.differ(&batch, traces, raw),
            }
        });
        for (task, trace) in traces.iter().flatten().enumerate() {
            for trajectory in source.data().trajectories() {
                trace.extend(&mut raw[trajectory.rows.clone()], task);
            }
        }
        Self::scale(&raw)
    }

    fn scale(raw: &[[f64; 2]]) -> Self {
        let scales = [0, 1].map(|task| {
            let mean = raw.iter().map(|pair| pair[task].abs()).sum::<f64>() / raw.len().max(1) as f64;
            // Without any difference between actions there is nothing to scale.
            if mean > 0.0 { mean } else { 1.0 }
        });
        let scaled = raw.iter().map(|[reward, cost]| [(reward / scales[0]) as f32, (cost / scales[1]) as f32]);
        Self { scaled: scaled.collect(), scales }
    }
}

impl<T: Scalar> Judges<'_, T> {
    /// The temporal differences of reward and long-term cost of a batch `[B]`: what is behind an
    /// episode's end counts as it does for the critics.
    fn differ(&self, batch: &Batch<T>, traces: [Trace; 2], out: &mut [[f64; 2]]) {
        let (value, parameters) = self.value;
        let [mut here, mut next] = [(); 2].map(|()| value.tape(batch.samples()));
        value.forward(parameters, &TASKS, (&batch.state, &batch.kappa), &mut here, false);
        value.forward(parameters, &TASKS, (&batch.next_state, &batch.next_kappa), &mut next, false);
        for (place, (task, signal)) in TASKS.into_iter().zip([&batch.reward, &batch.cost]).enumerate() {
            let values = here.values(task).zip(next.values(task)).zip(signal.iter().zip(&batch.alive));
            for (out, ((here, next), (signal, alive))) in out.iter_mut().zip(values) {
                let ahead = traces[place].discount * alive.to_f64() * next.to_f64();
                out[place] = signal.to_f64() + ahead - here.to_f64();
            }
        }
    }

    /// `A_r` and `A_cL` of a batch `[B]`.
    fn judge(&self, batch: &Batch<T>, out: &mut [[f64; 2]]) {
        let ((critic, target), (value, parameters)) = (self.critic, self.value);
        let (mut actions, mut states) = (critic.tape(batch.samples()), value.tape(batch.samples()));
        critic.forward(target, &TASKS, (&batch.state, &batch.kappa, &batch.action), &mut actions, false);
        value.forward(parameters, &TASKS, (&batch.state, &batch.kappa), &mut states, false);
        for (place, task) in TASKS.into_iter().enumerate() {
            let pairs = actions.pessimistic(task).zip(states.values(task));
            for (out, (q, v)) in out.iter_mut().zip(pairs) {
                out[place] = (q - v).to_f64();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Preset;
    use crate::data::Mask;
    use crate::extraction::Advantage;
    use crate::normaliser::Normaliser;
    use crate::testing::{fill, recording};

    #[test]
    fn scaled_advantages_have_a_mean_size_of_one() {
        let advantages = Advantages::scale(&[[3.0, 0.0], [-5.0, 0.0]]);
        assert_eq!(advantages.scales, [4.0, 1.0]);
        assert_eq!(advantages.scaled, [[0.75, 0.0], [-1.25, 0.0]]);
    }

    /// More transitions than a share, so that its seams are met.
    #[test]
    fn each_transition_has_the_advantage_of_its_own_action() {
        let data = recording(40, 5, |_| 1.0, |row| f32::from(row % 3 == 0));
        let config = Preset::Quick.config("own", 1.0);
        let normaliser = Normaliser::new(&data, true);
        let source = Source::new(&config, &data, &normaliser);
        let (critic, value) = (Critic::new(2, 1, 4, 4, 1.0), StateValue::new(2, 4, 1.0, [0.5; 3]));
        let (target, values) = (fill(critic.size(), 1), fill(value.size(), 2));
        let judges = Judges { critic: (&critic, &target), value: (&value, &values) };
        let advantages = Advantages::new(&source, judges, None);
        for row in [0, 1, SHARE - 1, SHARE, data.len() - 1] {
            let mut batch = source.room(1);
            source.fill(&mut batch, 0, row, 0.0);
            let mut alone = [[0.0; 2]];
            judges.judge(&batch, &mut alone);
            let pairs = advantages.scaled[row].iter().zip(advantages.scales);
            for ((scaled, scale), expected) in pairs.zip(alone[0]) {
                let found = f64::from(*scaled) * scale;
                assert!((found - expected).abs() < 1e-6, "row {row}: {found} is not {expected}");
            }
        }
    }

    /// What is behind the end of an episode counts where it does in the critics' targets: here all
    /// episodes end by their time.
    #[test]
    fn along_a_whole_trace_an_advantage_is_the_recorded_return_above_the_value() {
        for (mask, alive) in [(Mask::Any, 0.0), (Mask::Terminal, 1.0)] {
            let data = recording(2, 70, |row| (row % 7) as f32, |row| f32::from(row % 3 == 0));
            let mut config = Preset::Quick.config("own", 1.0);
            (config.advantage, config.done_mask) = (Advantage::Recorded, mask);
            (config.reward_discount, config.long_cost_discount) = (0.9, 0.95);
            let normaliser = Normaliser::new(&data, true);
            let source = Source::new(&config, &data, &normaliser);
            let (critic, value) = (Critic::new(2, 1, 4, 4, 0.0), StateValue::new(2, 4, 0.0, [0.5; 3]));
            let (target, values) = (fill(critic.size(), 1), fill(value.size(), 2));
            let judges = Judges { critic: (&critic, &target), value: (&value, &values) };
            let found = Advantages::new(&source, judges, config.traces());
            let values_at = |row: usize, next: bool| {
                let mut batch = source.room(1);
                source.fill(&mut batch, 0, row, 0.0);
                let mut tape = value.tape(1);
                let state = if next { &batch.next_state } else { &batch.state };
                value.forward(&values, &TASKS, (state, &batch.kappa), &mut tape, false);
                TASKS.map(|task| tape.values(task).next().unwrap())
            };
            for row in [0, 3, 69, 70, SHARE, 139] {
                let end = data.trajectories()[data.trajectory(row)].rows.end;
                let (own, behind) = (values_at(row, false), values_at(end - 1, true));
                for (place, discount) in [0.9f64, 0.95].into_iter().enumerate() {
                    let signal = |row: usize| match place {
                        0 => config.reward_scale * f64::from(data.reward(row)),
                        _ => f64::from(data.cost(row)),
                    };
                    let power = |later: usize| discount.powi((later - row) as i32);
                    let sum: f64 = (row..end).map(|later| power(later) * signal(later)).sum();
                    let expected = sum + alive * power(end) * behind[place] - own[place];
                    let advantage = f64::from(found.scaled[row][place]) * found.scales[place];
                    assert!((advantage - expected).abs() < 1e-6, "row {row}: {advantage} is not {expected}");
                }
            }
        }
    }
}
