//! The knots of a budget map, and their file.

use std::path::Path;

use armor_core::budget_map::{BudgetMap, MAX_KNOTS};
use armor_core::units::Cost;
use firmware_sim::file;

use super::CalibrateError;

/// The map of a calibrated run, within its folder: budgets in units of recorded cost, and leniencies.
pub const MAP_FILE: &str = "budget_map.csv";
const HEADER: &str = "budget,leniency";
/// Steps of a unit of cost in an image.
const STEPS: f64 = 65536.0;

/// A map from the remaining budget to the condition of a policy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Knots(Vec<[u32; 2]>);

impl Knots {
    /// The map that gives every budget the same condition.
    pub fn constant(condition: f32) -> Self {
        Self(vec![[0, condition.to_bits()], [Cost::MAX.to_raw(), condition.to_bits()]])
    }

    /// The map that gives each budget the boldest leniency whose estimated cost of an episode, times
    /// `margin`, fits: linear between the leniencies that were judged, which rise.
    ///
    /// A leniency that is not dearer than a stricter one is left out: noise of an estimate shall not
    /// make the policy bolder. Below the strictest policy's cost the strictest flies.
    pub fn choose(leniencies: &[f64], costs: &[f64], margin: f64) -> Self {
        let strictest = leniencies.first().map_or(0.0, |&leniency| leniency as f32);
        let mut knots = vec![[0, strictest.to_bits()]];
        let mut dearest = 0;
        for (&leniency, &cost) in leniencies.iter().zip(costs).take(MAX_KNOTS - 1) {
            let budget = Cost::from_incurred((cost * margin) as f32).unwrap_or(Cost::MAX).to_raw();
            if budget > dearest {
                knots.push([budget, (leniency as f32).to_bits()]);
                dearest = budget;
            }
        }
        if knots.len() == 1 {
            return Self::constant(strictest);
        }
        Self(knots)
    }

    /// The words of an image's section.
    pub fn words(&self) -> Vec<u32> {
        self.0.concat()
    }

    /// The map as the controller applies it.
    pub fn map(&self) -> Option<BudgetMap<'_>> {
        BudgetMap::new(&self.0)
    }

    /// Writes the map into a run's folder, whole or not at all.
    ///
    /// # Errors
    /// [`CalibrateError::File`]
    pub fn write(&self, folder: &Path) -> Result<(), CalibrateError> {
        let line =
            |&[budget, leniency]: &[u32; 2]| format!("{},{}\n", f64::from(budget) / STEPS, f32::from_bits(leniency));
        let text: String = std::iter::once(format!("{HEADER}\n")).chain(self.0.iter().map(line)).collect();
        Ok(file::write(&folder.join(MAP_FILE), text.as_bytes())?)
    }

    /// The map in a run's folder; none if it was never calibrated.
    ///
    /// # Errors
    /// [`CalibrateError::File`] and [`CalibrateError::Map`]
    pub fn read(folder: &Path) -> Result<Option<Self>, CalibrateError> {
        let path = folder.join(MAP_FILE);
        if !path.exists() {
            return Ok(None);
        }
        let bytes = file::read(&path)?;
        let knots = Self::parse(&String::from_utf8_lossy(&bytes));
        knots.map(Some).ok_or(CalibrateError::Map { path })
    }

    fn parse(text: &str) -> Option<Self> {
        let mut lines = text.lines();
        let knot = |line: &str| {
            let (budget, leniency) = line.split_once(',')?;
            let steps = budget.trim().parse::<f64>().ok()? * STEPS;
            let budget = (0.0..=f64::from(u32::MAX)).contains(&steps).then_some(steps.round() as u32)?;
            let leniency = leniency.trim().parse::<f32>().ok().filter(|value| (0.0..=1.0).contains(value))?;
            Some([budget, leniency.to_bits()])
        };
        let knots = (lines.next()? == HEADER).then(|| lines.map(knot).collect::<Option<Vec<_>>>())??;
        let knots = Self(knots);
        knots.map().is_some().then_some(knots)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn condition(knots: &Knots, budget: f32) -> f32 {
        knots.map().unwrap().condition(Cost::from_incurred(budget).unwrap())
    }

    #[test]
    fn each_budget_gets_the_boldest_policy_that_fits() {
        let knots = Knots::choose(&[0.0, 0.5, 1.0], &[2.0, 4.0, 12.0], 1.0);
        for (budget, expected) in
            [(0.0, 0.0), (2.0, 0.0), (3.0, 0.25), (4.0, 0.5), (8.0, 0.75), (12.0, 1.0), (99.0, 1.0)]
        {
            assert_eq!(condition(&knots, budget), expected, "{budget}");
        }
        let careful = Knots::choose(&[0.0, 0.5, 1.0], &[2.0, 4.0, 12.0], 2.0);
        assert_eq!(condition(&careful, 8.0), 0.5);
    }

    #[test]
    fn a_dip_of_an_estimate_makes_no_policy_bolder() {
        let dip = Knots::choose(&[0.0, 0.25, 0.5, 0.75, 1.0], &[1.0, 5.0, 3.0, 4.0, 9.0], 1.0);
        for (budget, expected) in [(3.0, 0.125), (5.0, 0.25), (7.0, 0.625), (9.0, 1.0)] {
            assert_eq!(condition(&dip, budget), expected, "{budget}");
        }
    }

    #[test]
    fn where_no_cost_tells_policies_apart_the_strictest_flies() {
        for costs in [[0.0, 0.0], [3.0, 3.0], [3.0, 1.0]] {
            let knots = Knots::choose(&[0.0, 1.0], &costs, 1.0);
            assert_eq!([0.0, 2.0, 3.0, 9.0].map(|budget| condition(&knots, budget)), [0.0; 4], "{costs:?}");
        }
        assert_eq!([0.0, 9.0].map(|budget| condition(&Knots::constant(0.5), budget)), [0.5, 0.5]);
    }

    #[test]
    fn a_map_is_read_back_and_what_is_none_is_named() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(Knots::read(folder.path()).unwrap(), None);
        for knots in [Knots::choose(&[0.0, 0.3, 1.0], &[0.1, 4.7, 312.3], 1.0), Knots::constant(0.7)] {
            knots.write(folder.path()).unwrap();
            assert_eq!(Knots::read(folder.path()).unwrap(), Some(knots));
        }
        let good = "budget,leniency\n0,0\n5,1\n";
        assert!(Knots::parse(good).is_some());
        for bad in [
            "",
            "budget,leniency\n",
            "a,b\n0,0\n5,1\n",
            &good.replace("5,1", "5,1.5"),
            &good.replace("5,", "0,"),
            &good.replace("5,", "65536,"),
        ] {
            std::fs::write(folder.path().join(MAP_FILE), bad).unwrap();
            let error = Knots::read(folder.path()).unwrap_err();
            assert!(matches!(error, CalibrateError::Map { .. }), "{bad}");
        }
    }
}
