//! What a policy is conditioned on at a remaining budget, where that is not the budget itself.
//!
//! A policy may be conditioned on how cheap cost shall be instead of on kappa.
//! Its image then carries a table, chosen when it was exported, from the
//! remaining budget to that condition: piecewise linear, constant beyond its
//! ends, and never falling, so that a smaller budget is never bolder.

use crate::units::Cost;

/// Fewest knots of a map.
pub const MIN_KNOTS: usize = 2;
/// Most knots of a map.
pub const MAX_KNOTS: usize = 64;

/// A map from the remaining budget to the condition of a policy, read in place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BudgetMap<'a> {
    knots: &'a [[u32; 2]],
}

impl<'a> BudgetMap<'a> {
    /// The map with these knots: a budget in steps of `2^-16`, and the bits of the condition there.
    ///
    /// `None` unless there are 2 to 64 knots whose budgets rise and whose
    /// conditions are finite and do not fall.
    pub fn new(knots: &'a [[u32; 2]]) -> Option<Self> {
        let map = Self { knots };
        let mut pairs = map.knots().zip(map.knots().skip(1));
        let sound = (MIN_KNOTS..=MAX_KNOTS).contains(&knots.len())
            && map.knots().all(|(_, condition)| condition.is_finite())
            && pairs.all(|((before, low), (after, high))| before < after && low <= high);
        sound.then_some(map)
    }

    /// Budgets and conditions, from the smallest budget up.
    pub fn knots(&self) -> impl Iterator<Item = (Cost, f32)> + use<'a> {
        self.knots.iter().map(|&[budget, condition]| (Cost::from_raw(budget), f32::from_bits(condition)))
    }

    /// The condition at a budget, `low + (kappa - before) / (after - before) (high - low)` between two
    /// knots, in f32 and in this order, at most `high`.
    pub fn condition(&self, kappa: Cost) -> f32 {
        let mut last: Option<(Cost, f32)> = None;
        for (after, high) in self.knots() {
            if kappa < after {
                return match last {
                    None => high,
                    Some((before, low)) => {
                        let share = steps(kappa, before) / steps(after, before);
                        // Rounding might carry the sum beyond the knot, and the next piece below it.
                        (low + share * (high - low)).min(high)
                    }
                };
            }
            last = Some((after, high));
        }
        last.map_or(0.0, |(_, condition)| condition)
    }
}

/// Steps of `2^-16` between two budgets.
fn steps(above: Cost, below: Cost) -> f32 {
    above.saturating_sub(below).to_raw() as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn knots(pairs: &[(f32, f32)]) -> Vec<[u32; 2]> {
        let raw = |budget: f32| Cost::from_incurred(budget).unwrap().to_raw();
        pairs.iter().map(|&(budget, condition)| [raw(budget), condition.to_bits()]).collect()
    }

    #[test]
    fn it_is_linear_between_knots_and_constant_beyond() {
        let knots = knots(&[(1.0, -0.5), (3.0, 0.5), (4.0, 0.5), (8.0, 1.0)]);
        let map = BudgetMap::new(&knots).unwrap();
        for (budget, expected) in
            [(0.0, -0.5), (1.0, -0.5), (1.5, -0.25), (3.0, 0.5), (3.5, 0.5), (5.0, 0.625), (8.0, 1.0), (9e4, 1.0)]
        {
            assert_eq!(map.condition(Cost::from_incurred(budget).unwrap()), expected, "{budget}");
        }
    }

    #[test]
    fn knots_that_make_no_map_are_refused() {
        for bad in [
            &[(1.0, 0.0)][..],
            &[(1.0, 0.0), (1.0, 1.0)],
            &[(2.0, 0.0), (1.0, 1.0)],
            &[(1.0, 1.0), (2.0, 0.5)],
            &[(1.0, f32::NAN), (2.0, 0.5)],
            &[(1.0, 0.0), (2.0, f32::INFINITY)],
        ] {
            assert_eq!(BudgetMap::new(&knots(bad)), None, "{bad:?}");
        }
        let line = |count: u32| (0..count).map(|knot| [knot, 0]).collect::<Vec<_>>();
        assert!(BudgetMap::new(&line(64)).is_some());
        assert_eq!(BudgetMap::new(&line(65)), None);
        assert_eq!(BudgetMap::new(&[]), None);
    }

    proptest! {
        #[test]
        fn a_smaller_budget_is_never_bolder(
            budgets in proptest::collection::btree_set(any::<u32>(), MIN_KNOTS..=MAX_KNOTS),
            conditions in proptest::collection::vec(-1e6f32..1e6, MAX_KNOTS),
            probes in proptest::collection::vec(any::<u32>(), 16),
        ) {
            let mut conditions = conditions;
            conditions.sort_by(f32::total_cmp);
            let knots: Vec<[u32; 2]> = budgets.iter().zip(&conditions).map(|(&b, c)| [b, c.to_bits()]).collect();
            let map = BudgetMap::new(&knots).unwrap();
            // Around every knot rounding is most dangerous.
            let around = budgets.iter().flat_map(|&b| [b.saturating_sub(1), b, b.saturating_add(1)]);
            let mut at: Vec<u32> = around.chain(probes).collect();
            at.sort_unstable();
            let values: Vec<f32> = at.iter().map(|&raw| map.condition(Cost::from_raw(raw))).collect();
            prop_assert!(values.is_sorted());
            prop_assert!(values.iter().all(|value| *value >= conditions[0] && *value <= conditions[knots.len() - 1]));
            for &[budget, condition] in &knots {
                prop_assert_eq!(map.condition(Cost::from_raw(budget)).to_bits(), condition);
            }
        }
    }
}
