//! Which trajectories the actor clones: those that keep to safe states.
//!
//! ```text
//! rho_i = mean_t V_cL(s_t, kappa_t)
//! ```
//!
//! What a trajectory itself cost is in part luck: a driver along a wall is within the limit until
//! he slips once, and a clone slips sooner than he. `V_cL` is what all recorded drivers cost from a
//! state on, so that `rho` is high for a trajectory that others would not have survived.

use std::ops::Range;

use rayon::prelude::*;

use crate::batch::Batch;
use crate::critic::Task;
use crate::critic::value::StateValue;
use crate::learner::SHARE;
use crate::nn::Scalar;
use crate::source::Source;

/// The rows of the trajectories with the least risk: `share` of those within `limit`, in units of
/// recorded cost; of all where none is. At least one, in the order of the data.
pub(crate) fn safest<T: Scalar>(
    source: &Source<'_>,
    value: (&StateValue, &[T]),
    (share, limit): (f64, f64),
) -> Vec<Range<usize>> {
    let trajectories = source.data().trajectories();
    let within: Vec<usize> =
        (0..trajectories.len()).filter(|&index| f64::from(trajectories[index].cost_return) <= limit).collect();
    let candidates = if within.is_empty() { (0..trajectories.len()).collect() } else { within };
    let mut ranked: Vec<(f64, usize)> =
        candidates.par_iter().map(|&index| (risk(source, value, trajectories[index].rows.clone()), index)).collect();
    ranked.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    ranked.truncate(((share * ranked.len() as f64).ceil() as usize).max(1));
    let mut kept: Vec<usize> = ranked.into_iter().map(|(_, index)| index).collect();
    kept.sort_unstable();
    kept.into_iter().map(|index| trajectories[index].rows.clone()).collect()
}

/// The mean long-term cost from the states of `rows` on, in units of scaled cost.
fn risk<T: Scalar>(source: &Source<'_>, (value, parameters): (&StateValue, &[T]), rows: Range<usize>) -> f64 {
    let mut sum = 0.0;
    for first in rows.clone().step_by(SHARE) {
        let share = first..rows.end.min(first + SHARE);
        let mut batch: Batch<T> = source.room(share.len());
        for (sample, row) in share.enumerate() {
            source.fill(&mut batch, sample, row, 0.0);
        }
        let mut tape = value.tape(batch.samples());
        value.forward(parameters, &[Task::LongCost], (&batch.state, &batch.kappa), &mut tape, false);
        sum += tape.values(Task::LongCost).map(Scalar::to_f64).sum::<f64>();
    }
    sum / rows.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Preset;
    use crate::normaliser::Normaliser;
    use crate::testing::{fill, recording};

    /// Eight trajectories of 140 rows, more than a share; the odd ones cost 140.
    fn kept(share: f64, limit: f64) -> (Vec<Range<usize>>, Vec<f64>) {
        let data = recording(8, 140, |_| 1.0, |row| f32::from(row / 140 % 2 == 1));
        let config = Preset::Quick.config("own", 1.0);
        let normaliser = Normaliser::new(&data, true);
        let source = Source::new(&config, &data, &normaliser);
        let network = StateValue::new(2, 4, 1.0, [0.5; 3]);
        let parameters = fill(network.size(), 3);
        let value = (&network, &parameters[..]);
        let one_by_one = |row: usize| risk(&source, value, row..row + 1);
        let risks = (0..8).map(|index| (index * 140..(index + 1) * 140).map(one_by_one).sum::<f64>() / 140.0);
        (safest(&source, value, (share, limit)), risks.collect())
    }

    #[test]
    fn of_those_within_the_limit_the_least_risky_are_kept() {
        let (kept, risks) = kept(0.5, 10.0);
        let mut expected = [0, 2, 4, 6];
        expected.sort_by(|&a, &b| risks[a].total_cmp(&risks[b]));
        let mut expected = expected[..2].to_vec();
        expected.sort_unstable();
        assert_eq!(kept, expected.iter().map(|index| index * 140..(index + 1) * 140).collect::<Vec<_>>());
    }

    #[test]
    fn a_limit_that_none_keeps_leaves_all_to_choose_from_and_a_small_share_leaves_one() {
        let (all, risks) = kept(1.0, -1.0);
        assert_eq!(all, (0..8).map(|index| index * 140..(index + 1) * 140).collect::<Vec<_>>());
        let least = (0..8).min_by(|&a, &b| risks[a].total_cmp(&risks[b])).unwrap();
        assert_eq!(kept(1e-9, -1.0).0, vec![least * 140..(least + 1) * 140]);
    }
}
