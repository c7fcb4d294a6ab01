//! What a run measures while it learns.

use serde::{Deserialize, Serialize};

use super::columns::COLUMNS;
use crate::extraction::weight::BatchWeights;
use crate::learner::Metrics;
use crate::reweight::WeightSummary;

/// Steps between rows of `metrics.csv`.
pub(super) const ROW_STEPS: u64 = 100;

/// One row of `metrics.csv`; [`COLUMNS`] says what each number is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    pub(super) step: u64,
    pub(super) critic_loss: [f64; 3],
    pub(super) value_loss: [f64; 3],
    pub(super) conflicts: [f64; 4],
    pub(super) cloning: f64,
    /// Smallest, mean, largest.
    pub(super) q_reward: [f64; 3],
    /// Smallest, mean, largest.
    pub(super) q_long_cost: [f64; 3],
    pub(super) lambda: f64,
    pub(super) penalty: f64,
    pub(super) lambda_by_kappa: [f64; 4],
    pub(super) trunk_norms: [f64; 3],
    pub(super) gradient_norms: [f64; 3],
    pub(super) weights: WeightSummary,
    pub(super) batch_weights: BatchWeights,
    pub(super) advantage_scales: [f64; 2],
}

/// What is measured at a row's last step alone.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Snapshot {
    /// `lambda(kappa)` at 0, half the limit, the limit, and the data's largest kappa.
    pub(super) lambda_by_kappa: [f64; 4],
    /// The weights of all transitions.
    pub(super) weights: WeightSummary,
    /// The scales of the advantages; 0 where there are none yet.
    pub(super) advantage_scales: [f64; 2],
}

impl Row {
    /// The numbers in the order of [`COLUMNS`].
    pub(super) fn values(&self) -> Vec<f64> {
        COLUMNS.iter().map(|column| (column.value)(self)).collect()
    }
}

/// What was measured since the last row.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Window {
    steps: u64,
    /// Steps that trained the critics, the actor, the actor by advantage weights, and that measured values.
    critic_steps: u64,
    actor_steps: u64,
    weighted_steps: u64,
    valued_steps: u64,
    /// Sums of the losses, and of the actor's cloning, lambda, penalty.
    critic_loss: [f64; 3],
    value_loss: [f64; 3],
    actor: [f64; 3],
    trunk_norms: [f64; 3],
    gradient_norms: [f64; 3],
    conflicts: [u64; 4],
    /// Sums of mean weight and effective share.
    batch_weights: [f64; 2],
    /// Smallest, sum and largest of `Q_r` and of `Q_cL`.
    values: [[f64; 3]; 2],
}

impl Window {
    /// Adds one step.
    pub fn push(&mut self, metrics: &Metrics) {
        let Metrics { critic, actor, batch_weights, values, gradient_norms } = metrics;
        if let Some(critic) = critic {
            add(&mut self.critic_loss, critic.losses);
            add(&mut self.value_loss, critic.value_losses);
            add(&mut self.trunk_norms, critic.surgery.norms);
            self.conflicts[critic.surgery.conflicts] += 1;
            self.critic_steps += 1;
        }
        if let Some(actor) = actor {
            add(&mut self.actor, [actor.cloning, actor.lambda, actor.penalty]);
            self.actor_steps += 1;
        }
        if let Some(weights) = batch_weights {
            add(&mut self.batch_weights, [weights.mean, weights.effective]);
            self.weighted_steps += 1;
        }
        add(&mut self.gradient_norms, *gradient_norms);
        if let Some(values) = values {
            for (so_far, &[low, mean, high]) in self.values.iter_mut().zip(values) {
                let [lowest, sum, highest] = *so_far;
                let is_first = self.valued_steps == 0;
                *so_far = if is_first { [low, mean, high] } else { [lowest.min(low), sum + mean, highest.max(high)] };
            }
            self.valued_steps += 1;
        }
        self.steps += 1;
    }

    /// Name of the first column that is no finite number, if there is one.
    pub fn not_finite(&self) -> Option<&'static str> {
        let row = self.row(0, &Snapshot::default());
        COLUMNS.iter().find(|column| !(column.value)(&row).is_finite()).map(|column| column.name)
    }

    /// Whether a row is due.
    pub const fn is_full(&self) -> bool {
        self.steps >= ROW_STEPS
    }

    /// The row up to `step`; the window is empty then.
    pub(super) fn take_row(&mut self, step: u64, snapshot: &Snapshot) -> Row {
        std::mem::take(self).row(step, snapshot)
    }

    fn row(&self, step: u64, snapshot: &Snapshot) -> Row {
        // A network that did not train leaves zeros.
        let over = |steps: u64| move |sum: f64| sum / steps.max(1) as f64;
        let (critic, actor) = (over(self.critic_steps), over(self.actor_steps));
        let [cloning, lambda, penalty] = self.actor.map(actor);
        let [q_reward, q_long_cost] = self.values.map(|[low, sum, high]| [low, over(self.valued_steps)(sum), high]);
        let [critic_norm, actor_norm, dual_norm] = self.gradient_norms;
        let [mean, effective] = self.batch_weights.map(over(self.weighted_steps));
        Row {
            step,
            critic_loss: self.critic_loss.map(critic),
            value_loss: self.value_loss.map(critic),
            conflicts: self.conflicts.map(|count| critic(count as f64)),
            cloning,
            q_reward,
            q_long_cost,
            lambda,
            penalty,
            lambda_by_kappa: snapshot.lambda_by_kappa,
            trunk_norms: self.trunk_norms.map(critic),
            gradient_norms: [critic(critic_norm), actor(actor_norm), actor(dual_norm)],
            weights: snapshot.weights,
            batch_weights: BatchWeights { mean, effective },
            advantage_scales: snapshot.advantage_scales,
        }
    }

    /// Mean cloning loss, mean `Q_r`, mean `Q_cL` and mean lambda since the last row.
    pub fn glance(&self) -> [f64; 4] {
        let row = self.row(0, &Snapshot::default());
        [row.cloning, row.q_reward[1], row.q_long_cost[1], row.lambda]
    }
}

fn add<const N: usize>(sums: &mut [f64; N], values: [f64; N]) {
    sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actor::ActorLoss;
    use crate::pcgrad::Surgery;
    use crate::run::columns::value;
    use crate::update::CriticMetrics;

    fn metrics(cloning: f64, conflicts: usize) -> Metrics {
        let surgery = Surgery { conflicts, norms: [10.0, 11.0, 12.0] };
        Metrics {
            critic: Some(CriticMetrics { losses: [1.0, 2.0, 3.0], value_losses: [1.5, 2.5, 3.5], surgery }),
            actor: Some(ActorLoss {
                cloning,
                reward: 5.0,
                reward_size: 5.0,
                long_cost: 6.0,
                penalty: 8.0,
                lambda: 7.0,
            }),
            batch_weights: Some(BatchWeights { mean: 16.0, effective: 0.75 }),
            values: Some([[5.0 - cloning, 5.0, 5.0 + cloning], [6.0, 6.25, 6.5]]),
            gradient_norms: [13.0, 14.0, 15.0],
        }
    }

    #[test]
    fn a_row_holds_means_and_extremes_under_their_names() {
        let mut window = Window::default();
        window.push(&metrics(3.0, 0));
        window.push(&metrics(5.0, 2));
        let weights = WeightSummary { active: 0.25, quantiles: [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7] };
        let snapshot = Snapshot { lambda_by_kappa: [1.5, 2.5, 3.5, 4.5], weights, advantage_scales: [0.5, 0.25] };
        let row = window.take_row(200, &snapshot).values();
        assert_eq!(row.len(), COLUMNS.len());
        assert_eq!(window, Window::default());
        for (name, expected) in [
            ("step", 200.0),
            ("critic_loss_reward", 1.0),
            ("critic_loss_long_cost", 2.0),
            ("critic_loss_short_cost", 3.0),
            ("value_loss_reward", 1.5),
            ("value_loss_long_cost", 2.5),
            ("value_loss_short_cost", 3.5),
            ("conflicts_0", 0.5),
            ("conflicts_1", 0.0),
            ("conflicts_2", 0.5),
            ("conflicts_3", 0.0),
            ("cloning_loss", 4.0),
            ("q_reward_min", 0.0),
            ("q_reward", 5.0),
            ("q_reward_max", 10.0),
            ("q_long_cost_min", 6.0),
            ("q_long_cost", 6.25),
            ("q_long_cost_max", 6.5),
            ("lambda", 7.0),
            ("penalty", 8.0),
            ("lambda_kappa_0", 1.5),
            ("lambda_kappa_half", 2.5),
            ("lambda_kappa_limit", 3.5),
            ("lambda_kappa_max", 4.5),
            ("gradient_trunk_reward", 10.0),
            ("gradient_trunk_long_cost", 11.0),
            ("gradient_trunk_short_cost", 12.0),
            ("gradient_critic", 13.0),
            ("gradient_actor", 14.0),
            ("gradient_dual", 15.0),
            ("counterfactual_active", 0.25),
            ("weight_min", 0.1),
            ("weight_p10", 0.2),
            ("weight_p50", 0.3),
            ("weight_p90", 0.4),
            ("weight_p95", 0.5),
            ("weight_p99", 0.6),
            ("weight_max", 0.7),
            ("advantage_weight_mean", 16.0),
            ("advantage_weight_effective", 0.75),
            ("advantage_scale_reward", 0.5),
            ("advantage_scale_cost", 0.25),
        ] {
            assert_eq!(value(&row, name), expected, "{name}");
        }
    }

    #[test]
    fn means_are_over_the_steps_that_trained_a_network() {
        let mut window = Window::default();
        window.push(&Metrics { actor: None, batch_weights: None, ..metrics(1.0, 1) });
        window.push(&Metrics { critic: None, ..metrics(3.0, 0) });
        window.push(&Metrics { critic: None, ..metrics(5.0, 0) });
        let row = window.take_row(300, &Snapshot::default()).values();
        let expected = [
            ("critic_loss_reward", 1.0),
            ("value_loss_reward", 1.5),
            ("conflicts_0", 0.0),
            ("conflicts_1", 1.0),
            ("cloning_loss", 4.0),
            ("advantage_weight_mean", 16.0),
        ];
        for (name, expected) in expected {
            assert_eq!(value(&row, name), expected, "{name}");
        }
    }

    #[test]
    fn the_first_number_that_is_not_finite_is_named() {
        let mut window = Window::default();
        window.push(&metrics(1.0, 0));
        assert_eq!(window.not_finite(), None);
        let mut broken = metrics(1.0, 0);
        broken.gradient_norms[1] = f64::INFINITY;
        window.push(&broken);
        assert_eq!(window.not_finite(), Some("gradient_actor"));
        window.push(&metrics(f64::NAN, 0));
        assert_eq!(window.not_finite(), Some("cloning_loss"));
    }
}
