//! Kappa, the remaining cost budget (sections 3.1 and 3.5).
//!
//! `kappa_0 = d`, then `kappa_{t+1} = max(0, kappa_t - c_t)`. The budget only
//! falls and stops at zero; nothing but making a new one refills it, and a
//! report that is no cost takes all that is left.

use crate::units::{Cost, CostLimit};

/// The cost that an episode may still incur.
///
/// Not `Clone`, so that a spent budget cannot be put back.
#[derive(Debug)]
pub struct Budget {
    remaining: Cost,
}

/// The report of an incurred cost was negative, NaN or infinite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InvalidCost;

impl Budget {
    /// The full budget of a new episode.
    pub const fn new(limit: CostLimit) -> Self {
        Self { remaining: limit.cost() }
    }

    /// Takes an incurred cost off the budget.
    ///
    /// # Errors
    /// [`InvalidCost`] if `incurred` is not a finite non-negative number; the
    /// whole remaining budget is charged then, for the true cost is unknown.
    pub fn charge(&mut self, incurred: f32) -> Result<(), InvalidCost> {
        match Cost::from_incurred(incurred) {
            Some(cost) => {
                self.remaining = self.remaining.saturating_sub(cost);
                Ok(())
            }
            None => {
                self.remaining = Cost::ZERO;
                Err(InvalidCost)
            }
        }
    }

    /// What is left: `kappa_t`.
    pub const fn remaining(&self) -> Cost {
        self.remaining
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn budget(d: f32) -> Budget {
        Budget::new(CostLimit::new(d).unwrap())
    }

    #[test]
    fn it_falls_by_each_cost_and_stops_at_zero() {
        let mut budget = budget(2.5);
        budget.charge(1.0).unwrap();
        assert_eq!(budget.remaining().to_f32(), 1.5);
        budget.charge(0.0).unwrap();
        assert_eq!(budget.remaining().to_f32(), 1.5);
        budget.charge(7.0).unwrap();
        assert_eq!(budget.remaining(), Cost::ZERO);
    }

    #[test]
    fn a_report_that_is_no_cost_takes_everything() {
        for bad in [f32::NAN, f32::INFINITY, -1.0] {
            let mut budget = budget(20.0);
            assert_eq!(budget.charge(bad), Err(InvalidCost));
            assert_eq!(budget.remaining(), Cost::ZERO);
        }
    }

    #[test]
    fn a_million_small_costs_add_up_exactly() {
        let mut budget = budget(1000.0);
        for _ in 0..1_000_000 {
            budget.charge(1.0 / 1024.0).unwrap();
        }
        assert_eq!(budget.remaining().to_f32(), 1000.0 - 1_000_000.0 / 1024.0);
    }

    proptest! {
        #[test]
        fn it_never_grows_and_never_undercharges(
            limit in 0.0f32..60_000.0,
            bits in proptest::collection::vec(any::<u32>(), 1..64),
        ) {
            let mut budget = budget(limit);
            let mut reported = 0.0f64;
            for bits in bits {
                let cost = f32::from_bits(bits);
                let before = budget.remaining();
                let charged = budget.charge(cost);
                prop_assert!(budget.remaining() <= before);
                if charged.is_ok() {
                    reported += f64::from(cost);
                    let left = f64::from(budget.remaining().to_raw()) / 65536.0;
                    prop_assert!(left <= (f64::from(limit) - reported).max(0.0));
                } else {
                    prop_assert_eq!(budget.remaining(), Cost::ZERO);
                    break;
                }
            }
        }
    }
}
