//! The reports of a robot's cost monitor, made into what to charge.
//!
//! Reports travel: they come late, twice, or not at all. So the monitor numbers
//! its steps from the episode's start, and a step's cost is charged once and
//! only once. A step without a report when it is due is charged as the worst,
//! and a report that comes for it afterwards changes nothing, for a budget only
//! falls.
//!
//! Words: a step is *due* when its report should have come, by the
//! controller's own clock or because a later one came; it is *settled* once it
//! was charged.

use armor_core::units::Cost;

/// What the monitor says of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CostReport {
    /// Number of the step, from 0 at the episode's start.
    pub step: u32,
    /// The cost that it incurred.
    pub cost: f32,
}

/// Keeps account of which steps were charged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CostMeter {
    worst: Cost,
    /// The first step that is not settled; none after a reset, until a report says.
    next: Option<u32>,
    /// Steps that were due and charged since a reset, until a report says where the episode stands.
    blind: u32,
}

/// What [`CostMeter::settle`] found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settled {
    /// What to charge: for `Controller::step`. Where a report is no cost, that report.
    pub incurred: f32,
    /// Steps that were charged as the worst, for they had no report.
    pub missing: u32,
    /// Reports that came twice, or of steps that had been settled before.
    pub stale: u32,
}

impl CostMeter {
    /// The meter of a new episode; no step costs more than `worst`.
    pub const fn new(worst: Cost) -> Self {
        Self { worst, next: Some(0), blind: 0 }
    }

    /// The meter after a reset in mid-episode: it goes on from the first
    /// reports that come. Until then all that are due by a clock that begins
    /// at 0 are charged as the worst; the steps while the controller was down
    /// are the journal's to cover.
    pub const fn resumed(worst: Cost) -> Self {
        Self { worst, next: None, blind: 0 }
    }

    /// The first step that is not settled; none where no report came since a reset.
    pub const fn next(&self) -> Option<u32> {
        self.next
    }

    /// Settles all steps below `due`, and all up to the latest that `reports`,
    /// those that came since the last call, know of. Of several for a step the
    /// largest counts, and one that is no cost before all.
    pub fn settle(&mut self, reports: &[CostReport], due: u32) -> Settled {
        let numbers = || reports.iter().map(|report| report.step);
        let (Some(first), Some(last)) = (self.next.or(numbers().min()), numbers().max().or(self.next)) else {
            // Nobody has said yet where the episode stands.
            let missing = due.saturating_sub(self.blind).max(1);
            self.blind = self.blind.max(due);
            return Settled { incurred: self.worst.saturating_mul(missing).to_f32(), missing, stale: 0 };
        };
        let known = if numbers().next().is_some() { last.saturating_add(1) } else { first };
        let end = known.max(due).max(first);
        let mut settled =
            Settled { stale: numbers().filter(|&step| step < first).count() as u32, ..Settled::default() };
        let (mut sum, mut told) = (Cost::ZERO, 0);
        for (index, report) in reports.iter().enumerate().filter(|(_, report)| (first..end).contains(&report.step)) {
            let of_step = |other: &&CostReport| other.step == report.step;
            if reports.iter().take(index).any(|other| of_step(&other)) {
                settled.stale += 1;
                continue;
            }
            let mut cost = Cost::ZERO;
            for other in reports.iter().filter(of_step) {
                match Cost::from_incurred(other.cost) {
                    Some(reported) => cost = cost.max(reported),
                    None => settled.incurred = other.cost,
                }
            }
            told += 1;
            sum = sum.saturating_add(cost);
        }
        settled.missing = end - first - told;
        sum = sum.saturating_add(self.worst.saturating_mul(settled.missing));
        self.next = Some(end);
        // Nothing but a report that is no cost has set it yet.
        if settled.incurred == 0.0 {
            settled.incurred = sum.to_f32();
        }
        settled
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn cost(units: f32) -> Cost {
        Cost::from_incurred(units).unwrap()
    }

    fn reports(pairs: &[(u32, f32)]) -> Vec<CostReport> {
        pairs.iter().map(|&(step, cost)| CostReport { step, cost }).collect()
    }

    fn settled(incurred: f32, missing: u32, stale: u32) -> Settled {
        Settled { incurred, missing, stale }
    }

    #[test]
    fn each_step_is_charged_once_whenever_its_report_comes() {
        let mut meter = CostMeter::new(cost(1.0));
        assert_eq!(meter.settle(&[], 0), settled(0.0, 0, 0));
        assert_eq!(meter.settle(&reports(&[(0, 0.25), (0, 0.25)]), 1), settled(0.25, 0, 1));
        // Step 1 is late, and was the worst; then it comes, with step 2.
        assert_eq!(meter.settle(&[], 2), settled(1.0, 1, 0));
        assert_eq!(meter.settle(&reports(&[(1, 0.5), (2, 0.5)]), 3), settled(0.5, 0, 1));
        // A slow clock expects step 3 at most, and step 5 has come.
        assert_eq!(meter.settle(&reports(&[(5, 0.0), (3, 0.0)]), 4), settled(1.0, 1, 0));
        assert_eq!(meter.next(), Some(6));
        // A clock that jumped ahead finds all missing, and settles none twice.
        assert_eq!(meter.settle(&reports(&[(6, 0.0)]), 10), settled(3.0, 3, 0));
        assert_eq!(meter.settle(&reports(&[(7, 1.0), (8, 1.0), (9, 1.0)]), 10), settled(0.0, 0, 3));
    }

    #[test]
    fn after_a_reset_it_goes_on_where_the_reports_are() {
        let mut meter = CostMeter::resumed(cost(1.0));
        assert_eq!(meter.settle(&[], 0), settled(1.0, 1, 0));
        // Two plant steps to a control step, and a clock that jumps.
        assert_eq!(meter.settle(&[], 2), settled(2.0, 2, 0));
        assert_eq!(meter.settle(&[], 8), settled(6.0, 6, 0));
        assert_eq!(meter.settle(&[], 8), settled(1.0, 1, 0));
        assert_eq!(meter.settle(&reports(&[(41, 0.5), (42, 0.0)]), 0), settled(0.5, 0, 0));
        assert_eq!(meter.next(), Some(43));
    }

    #[test]
    fn a_report_that_is_no_cost_is_handed_on() {
        for bad in [-1.0, f32::INFINITY, f32::NAN] {
            let mut meter = CostMeter::new(cost(1.0));
            let found = meter.settle(&reports(&[(0, 0.0), (1, bad), (1, 0.5), (2, 0.0)]), 3);
            assert_eq!(found.incurred.to_bits(), bad.to_bits());
        }
    }

    proptest! {
        /// Whatever is lost, repeated, delayed or out of order: what was charged
        /// is never below the true cost of the steps that are settled.
        #[test]
        fn it_never_charges_too_little(
            costs in proptest::collection::vec(0.0f32..=1.0, 1..60),
            fates in proptest::collection::vec((0usize..8, 1usize..3), 60),
            dues in proptest::collection::vec(0u32..80, 68),
        ) {
            let mut meter = CostMeter::new(cost(1.0));
            let mut charged = 0.0f64;
            for (now, &due) in dues.iter().enumerate().take(costs.len() + 8) {
                let mut arrived = Vec::new();
                for (step, (&cost, &(delay, copies))) in costs.iter().zip(&fates).enumerate() {
                    // A delay of 7 is for ever.
                    if delay < 7 && step + delay == now {
                        arrived.extend((0..copies).map(|_| CostReport { step: step as u32, cost }));
                    }
                }
                charged += f64::from(meter.settle(&arrived, due).incurred);
                let true_cost = |&cost: &f32| f64::from(Cost::from_incurred(cost).unwrap().to_f32());
                let next = meter.next().unwrap() as usize;
                prop_assert!(charged >= costs.iter().take(next).map(true_cost).sum::<f64>());
            }
        }
    }
}
