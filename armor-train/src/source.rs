//! From recorded transitions to the columns of a batch.

use armor_core::noise::uniform;

use crate::batch::Batch;
use crate::config::Config;
use crate::data::Dataset;
use crate::nn::Scalar;
use crate::normaliser::Normaliser;
use crate::threshold::{Threshold, ratio};

/// Recorded transitions as the networks see them.
pub(crate) struct Source<'a> {
    config: &'a Config,
    data: &'a Dataset,
    normaliser: &'a Normaliser,
}

impl<'a> Source<'a> {
    pub(crate) const fn new(config: &'a Config, data: &'a Dataset, normaliser: &'a Normaliser) -> Self {
        Self { config, data, normaliser }
    }

    /// The transitions as recorded.
    pub(crate) const fn data(&self) -> &Dataset {
        self.data
    }

    /// Room for `samples` transitions.
    pub(crate) fn room<T: Scalar>(&self, samples: usize) -> Batch<T> {
        Batch::zeros(self.data.state_dim(), self.data.action_dim(), samples)
    }

    /// What relabelling adds to the budget of a row, from two uniform words:
    /// with probability `relabel_share` the trajectory is taken as flown under
    /// a budget `b`, uniform between its cost `C_i` and the data's largest, so
    /// that `kappa'_t = kappa_t + (b - C_i)`. Any trajectory is valid under any
    /// larger budget, and `kappa' - c` still holds from step to step.
    pub(crate) fn larger_budget(&self, row: usize, chance: u32, word: u32) -> f32 {
        if f64::from(uniform(chance)) < self.config.relabel_share {
            uniform(word) * (self.data.max_kappa() - self.data.trajectory_cost(row)).max(0.0)
        } else {
            0.0
        }
    }

    /// Copies transition `row` to column `sample`, normalised and scaled (O-4,
    /// O-5), with `extra` added to its budget.
    pub(crate) fn fill<T: Scalar>(&self, batch: &mut Batch<T>, sample: usize, row: usize, extra: f32) {
        let (config, data) = (self.config, self.data);
        let normalise = |column: &mut [T], state: &[f32]| {
            for (out, value) in column.iter_mut().zip(self.normaliser.apply(state)) {
                *out = T::of_f32(value);
            }
        };
        normalise(batch.state.column_mut(sample).as_mut_slice(), data.observation(row));
        normalise(batch.next_state.column_mut(sample).as_mut_slice(), data.next_observation(row));
        for (out, &action) in batch.action.column_mut(sample).iter_mut().zip(data.action(row)) {
            *out = T::of_f32(action);
        }
        let cost = |value: f32| f64::from(value) * config.cost_scale;
        let kappa = cost(data.kappa(row) + extra);
        let remaining = data.trajectories()[data.trajectory(row)].rows.end - row;
        batch.reward[sample] = T::of(f64::from(data.reward(row)) * config.reward_scale);
        batch.cost[sample] = T::of(cost(data.cost(row)));
        batch.kappa[sample] = T::of(kappa);
        batch.condition[sample] = T::of(kappa);
        batch.next_kappa[sample] = T::of(cost(data.kappa_next(row) + extra));
        let spendable = match config.threshold {
            Threshold::Kappa => kappa,
            Threshold::Discounted => kappa * ratio(config.long_cost_discount, remaining),
        };
        batch.threshold[sample] = T::of(spendable + config.cost_scale * config.dual_slack);
        let ends = data.ending(row).is_some_and(|ending| config.done_mask.ends(ending));
        batch.alive[sample] = if ends { T::zero() } else { T::one() };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Preset;
    use crate::data::{Ending, Mask, Recording, Unfinished};
    use crate::testing::dataset;

    /// The batch of all rows of the test data, each budget raised by `extra`.
    fn batch(config: &Config, extra: f32) -> Batch<f64> {
        let data = dataset();
        let normaliser = Normaliser::new(&data, config.normalize_states);
        let source = Source::new(config, &data, &normaliser);
        let mut batch = source.room(data.len());
        (0..data.len()).for_each(|row| source.fill(&mut batch, row, row, extra));
        batch
    }

    /// Rows 0 to 1 end by the task's rule, 2 to 3 by the time limit, 4 to 5 not at all.
    fn endings(unfinished: Unfinished) -> Dataset {
        let rows = 6;
        let recording = Recording {
            state_dim: 1,
            action_dim: 1,
            observations: vec![0.0; rows],
            next_observations: vec![0.0; rows],
            actions: vec![0.0; rows],
            rewards: vec![0.0; rows],
            costs: vec![1.0; rows],
            terminals: (0..rows).map(|row| row == 1).collect(),
            timeouts: (0..rows).map(|row| row == 3).collect(),
            sha256: [0; 32],
        };
        Dataset::with_unfinished(recording, unfinished).unwrap()
    }

    #[test]
    fn what_ends_an_episode_for_good_is_a_choice() {
        let alive = |mask, unfinished| {
            let (data, mut config) = (endings(unfinished), Preset::Paper.config("own", 1.0));
            config.done_mask = mask;
            let normaliser = Normaliser::new(&data, false);
            let source = Source::new(&config, &data, &normaliser);
            let mut batch: Batch<f64> = source.room(data.len());
            (0..data.len()).for_each(|row| source.fill(&mut batch, row, row, 0.0));
            batch.alive
        };
        assert_eq!(alive(Mask::Any, Unfinished::Drop), [1.0, 0.0, 1.0, 0.0]);
        assert_eq!(alive(Mask::Terminal, Unfinished::Drop), [1.0, 0.0, 1.0, 1.0]);
        assert_eq!(alive(Mask::Any, Unfinished::Keep), [1.0, 0.0, 1.0, 0.0, 1.0, 1.0]);
    }

    #[test]
    fn an_unfinished_episode_is_left_out_or_costs_what_it_cost_until_then() {
        let [dropped, kept] = [Unfinished::Drop, Unfinished::Keep].map(endings);
        assert_eq!((dropped.trajectories().len(), kept.trajectories().len()), (2, 3));
        assert_eq!((dropped.after_last_end(), kept.after_last_end()), (2, 2));
        assert_eq!((kept.ending(5), kept.ending(4)), (Some(Ending::Unfinished), None));
        assert_eq!((kept.kappa(4), kept.kappa_next(4), kept.kappa_next(5)), (2.0, 1.0, 0.0));
    }

    #[test]
    fn a_larger_budget_still_falls_by_each_cost() {
        let mut config = Preset::Paper.config("own", 1.0);
        config.cost_scale = 0.5;
        for extra in [0.0, 3.0] {
            let batch = batch(&config, extra);
            for sample in 0..batch.samples() {
                assert_eq!(batch.next_kappa[sample], batch.kappa[sample] - batch.cost[sample]);
            }
            assert_eq!(batch.kappa[0], 0.5 * (2.0 + f64::from(extra)));
        }
    }

    #[test]
    fn relabelling_stays_within_the_datas_largest_budget() {
        let data = dataset();
        let mut config = Preset::Paper.config("own", 1.0);
        let normaliser = Normaliser::new(&data, false);
        assert_eq!(Source::new(&config, &data, &normaliser).larger_budget(3, 0, u32::MAX), 0.0);
        config.relabel_share = 1.0;
        let source = Source::new(&config, &data, &normaliser);
        // The second trajectory costs 0, the first 2.
        assert!((source.larger_budget(3, 0, u32::MAX) - 2.0).abs() < 1e-6);
        assert_eq!(source.larger_budget(3, 0, 0), 0.0);
        assert_eq!(source.larger_budget(0, 0, u32::MAX), 0.0);
    }

    #[test]
    fn the_paper_holds_the_cost_against_kappa_and_the_options_against_their_own_bound() {
        let mut config = Preset::Paper.config("own", 1.0);
        assert_eq!(batch(&config, 0.0).threshold, batch(&config, 0.0).kappa);
        config.threshold = Threshold::Discounted;
        config.dual_slack = 0.25;
        // Kappa is 2 with three steps to go.
        let expected = 2.0 * (1.0 + 0.99 + 0.99 * 0.99) / 3.0 + 0.25;
        assert!((batch(&config, 0.0).threshold[0] - expected).abs() < 1e-12);
    }
}
