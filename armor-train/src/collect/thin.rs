//! Which of many trajectories are kept, so that the kept ones have given statistics.

/// What the kept trajectories shall be like.
pub(super) struct Target {
    /// How many.
    pub(super) count: usize,
    /// Largest cost of a feasible one.
    pub(super) limit: f64,
    /// Share of feasible ones.
    pub(super) p_feas: f64,
    /// Mean cost of all.
    pub(super) mean_cost: f64,
}

/// The indices of the kept trajectories, ascending, out of those with the given costs.
///
/// The first feasible ones and the first others, as many as wanted of each; then
/// each of those left over takes a kept one's place if that brings the mean nearer.
/// Where there are too few of a kind, the other fills up.
pub(super) fn choose(costs: &[f64], target: &Target) -> Vec<usize> {
    let (feasible, others): (Vec<usize>, Vec<usize>) =
        (0..costs.len()).partition(|&index| costs[index] <= target.limit);
    let wanted = (target.p_feas * target.count as f64).round() as usize;
    let from_others = (target.count - wanted.min(feasible.len())).min(others.len());
    let from_feasible = (target.count - from_others).min(feasible.len());
    let (mut kept, spare) = (others[..from_others].to_vec(), &others[from_others..]);

    let sum = |indices: &[usize]| indices.iter().map(|&index| costs[index]).sum::<f64>();
    let mut missing = target.mean_cost * target.count as f64 - sum(&kept) - sum(&feasible[..from_feasible]);
    let places = 0..kept.len();
    for (&candidate, place) in spare.iter().zip(places.cycle()) {
        let change = costs[candidate] - costs[kept[place]];
        if (missing - change).abs() < missing.abs() {
            kept[place] = candidate;
            missing -= change;
        }
    }
    kept.extend_from_slice(&feasible[..from_feasible]);
    kept.sort_unstable();
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kept_ones_meet_share_and_mean() {
        let costs: Vec<f64> = (0..400).map(|index| f64::from(index * 37 % 100)).collect();
        let target = Target { count: 100, limit: 5.0, p_feas: 0.1, mean_cost: 30.0 };
        let kept = choose(&costs, &target);
        assert_eq!(kept.len(), 100);
        assert!(kept.windows(2).all(|pair| pair[0] < pair[1]));
        assert_eq!(kept.iter().filter(|&&index| costs[index] <= 5.0).count(), 10);
        let mean = kept.iter().map(|&index| costs[index]).sum::<f64>() / 100.0;
        assert!((mean - 30.0).abs() < 0.5, "{mean}");
    }

    #[test]
    fn too_few_of_a_kind_are_filled_up_with_the_other() {
        let target = Target { count: 3, limit: 0.0, p_feas: 1.0, mean_cost: 0.0 };
        assert_eq!(choose(&[0.0, 9.0, 8.0, 0.0], &target).len(), 3);
        let target = Target { p_feas: 0.0, ..target };
        assert_eq!(choose(&[0.0, 9.0, 0.0, 0.0], &target).len(), 3);
    }
}
