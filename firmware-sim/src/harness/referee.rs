//! Who watches that the robot stays within its budget and its bounds, knowing the truth.

use armor_core::units::{Cost, CostLimit};

/// The truth of an episode, and what was found against it.
#[derive(Clone, Debug)]
pub(super) struct Referee {
    limit: Cost,
    /// The cost of the first `n` plant steps, for every `n` so far.
    spent: Vec<Cost>,
    /// The controller's last budget.
    kappa: Cost,
    bounds: Vec<(f32, f32)>,
    budget_errors: u64,
    actions_out_of_range: u64,
}

impl Referee {
    /// A referee at the start of an episode; `bounds` are those of each action entry.
    pub(super) fn new(limit: CostLimit, bounds: Vec<(f32, f32)>) -> Self {
        let limit = limit.cost();
        Self { limit, spent: vec![Cost::ZERO], kappa: limit, bounds, budget_errors: 0, actions_out_of_range: 0 }
    }

    /// A plant step incurred a cost.
    pub(super) fn incurred(&mut self, cost: f64) {
        // The plants' costs are costs.
        let cost = Cost::from_incurred(cost as f32).unwrap_or(Cost::MAX);
        self.spent.push(self.spent.last().map_or(cost, |spent| spent.saturating_add(cost)));
    }

    /// What is truly left of the limit.
    pub(super) fn left(&self) -> Cost {
        self.after(self.spent.len())
    }

    /// What is left after the first `steps` plant steps.
    fn after(&self, steps: usize) -> Cost {
        let spent = self.spent.get(steps).or(self.spent.last());
        self.limit.saturating_sub(spent.copied().unwrap_or_default())
    }

    /// The controller has a budget after it was charged for its first `settled`
    /// plant steps, or, after a reset, for nothing that it knows of. An error is
    /// a budget that grew, or one above what these steps left: all of them
    /// where it does not know.
    pub(super) fn budget(&mut self, kappa: Cost, settled: Option<u32>) {
        let left = settled.map_or(self.left(), |steps| self.after(steps as usize));
        self.budget_errors += u64::from(kappa > self.kappa || kappa > left);
        self.kappa = kappa;
    }

    /// An action came to the actuators.
    pub(super) fn action(&mut self, action: &[f32]) {
        let within = action.iter().zip(&self.bounds).all(|(entry, (low, high))| (low..=high).contains(&entry));
        self.actions_out_of_range += u64::from(!within);
    }

    /// Budget errors and actions out of range so far.
    pub(super) const fn verdict(&self) -> (u64, u64) {
        (self.budget_errors, self.actions_out_of_range)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cost(units: f32) -> Cost {
        Cost::from_incurred(units).unwrap()
    }

    #[test]
    fn a_budget_that_grew_or_says_too_much_is_an_error() {
        let mut referee = Referee::new(CostLimit::new(5.0).unwrap(), vec![(-1.0, 1.0); 2]);
        for step in [1.0, 0.0, 2.0] {
            referee.incurred(step);
        }
        assert_eq!(referee.left(), cost(2.0));
        // Two steps are settled, of which one cost 1.
        referee.budget(cost(4.0), Some(2));
        referee.budget(cost(2.0), Some(3));
        assert_eq!(referee.verdict(), (0, 0));
        referee.budget(cost(2.5), Some(2));
        assert_eq!(referee.verdict(), (1, 0), "it grew");
        referee.budget(cost(2.25), None);
        assert_eq!(referee.verdict(), (2, 0), "2 are left");
    }

    #[test]
    fn an_action_out_of_range_is_counted() {
        let mut referee = Referee::new(CostLimit::new(5.0).unwrap(), vec![(-1.0, 1.0), (0.0, 0.5)]);
        for (action, out) in [([1.0, 0.5], 0), ([-1.1, 0.0], 1), ([0.0, -0.1], 2), ([f32::NAN, 0.0], 3)] {
            referee.action(&action);
            assert_eq!(referee.verdict(), (0, out));
        }
    }
}
