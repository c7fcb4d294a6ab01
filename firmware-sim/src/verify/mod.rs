//! The checks of an image, as an incoming inspection runs them.
//!
//! The image must be whole, reproduce its golden trace bit for bit, and agree
//! with a second evaluation of its own numbers (in f64 to rounding, in integers
//! exactly); and it must stop being
//! accepted when any bit of it changes or any byte of it is missing.

mod corruption;

use std::fmt;

use armor_core::image::PolicyImage;
use armor_core::units::CostLimit;
use armor_infer::Policy;
use serde::Serialize;

use crate::host::{self, HostController};
use crate::reference::{CriticReference, Estimate, Reference};

/// What the checks of an image found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verification {
    /// Whether every check passed.
    pub passed: bool,
    /// Length of the image; 0 if it is none.
    pub image_bytes: usize,
    /// Rows of the golden trace that were replayed.
    pub golden_rows: usize,
    /// Largest difference of an action entry between controller and reference.
    pub agreement_max_abs: Option<f64>,
    /// Each check, in the order of running; those that need an image are not
    /// run where there is none.
    pub checks: Vec<Check>,
}

/// A check and its outcome.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Check {
    /// What was checked.
    pub name: &'static str,
    /// Whether it passed.
    pub passed: bool,
    /// The figures behind it, or what is wrong.
    pub detail: String,
}

/// Runs every check on `bytes`, which start at a multiple of 16. Sampled
/// checks draw from `seed`.
pub fn verify(bytes: &[u8], seed: u64) -> Verification {
    let mut result =
        Verification { passed: false, image_bytes: 0, golden_rows: 0, agreement_max_abs: None, checks: Vec::new() };
    match PolicyImage::new_checked(bytes) {
        Err(error) => result.push("image", Err(error.to_string())),
        Ok(image) => {
            result.image_bytes = image.bytes().len();
            result.push("image", Ok(format!("{} bytes, format and checksums are right", result.image_bytes)));
            result.golden(&image);
            result.agreement(&image);
            if let Some(critic) = image.critic() {
                let choices = choices(&image, &CriticReference::new(critic));
                let of = |rows| format!("{rows} choices of {CHOICES} are the f64 reference's, to rounding");
                result.push("best of candidates", choices.map(of));
            }
            for (name, outcome) in corruption::run(&image, seed) {
                result.push(name, outcome);
            }
        }
    }
    result.passed = result.checks.iter().all(|check| check.passed);
    result
}

impl Verification {
    /// How many checks failed.
    pub fn failures(&self) -> usize {
        self.checks.iter().filter(|check| !check.passed).count()
    }

    fn push(&mut self, name: &'static str, outcome: Result<String, String>) {
        let passed = outcome.is_ok();
        let (Ok(detail) | Err(detail)) = outcome;
        self.checks.push(Check { name, passed, detail });
    }

    fn golden(&mut self, image: &PolicyImage<'_>) {
        let outcome = match host::check(image.bytes()) {
            Ok(checked) => {
                self.golden_rows = checked.golden_rows;
                Ok(format!("{} rows reproduced bit for bit", checked.golden_rows))
            }
            Err(error) => Err(error.to_string()),
        };
        self.push("golden trace", outcome);
    }

    fn agreement(&mut self, image: &PolicyImage<'_>) {
        let reference = Reference::new(image);
        let outcome = largest_difference(image, &reference).and_then(|largest| {
            self.agreement_max_abs = Some(largest);
            let (name, bound) = match reference {
                Reference::Float(_) => ("f64", reference.tolerance()),
                Reference::Integer(_) => ("integer", reference.tolerance()),
            };
            let detail = format!("largest difference from the {name} reference {largest:.1e}");
            // A NaN is no agreement.
            if largest <= bound { Ok(detail) } else { Err(format!("{detail}, above {bound:.0e}")) }
        });
        self.push("agreement", outcome);
    }
}

/// Flies the golden trace's states and costs on controller and reference.
fn largest_difference(image: &PolicyImage<'_>, reference: &Reference) -> Result<f64, String> {
    let golden = &image.sections().golden;
    let policy = Policy::load(image).map_err(|error| error.to_string())?;
    let limit = CostLimit::from_cost(golden.limit);
    let mut controller = HostController::new(policy, limit, golden.seed).map_err(|error| error.to_string())?;
    let mut differences = Vec::new();
    for (tick, row) in (0..).zip(golden.rows()) {
        let step = controller.step(row.state, row.incurred);
        if let Some(fault) = step.fault {
            return Err(format!("golden state {tick}: {fault}"));
        }
        let chain = reference.chain(step.rung.unwrap_or_default(), row.state, step.kappa, golden.seed, tick);
        let entries = step.action.iter().zip(&chain.action);
        differences.extend(entries.map(|(entry, expected)| (f64::from(*entry) - expected).abs()));
    }
    // By total order a NaN is the largest, and not lost.
    let largest = differences.into_iter().max_by(f64::total_cmp);
    largest.ok_or_else(|| "the image has no golden states to compare on".into())
}

/// Candidates of the check of choices.
const CHOICES: usize = 4;
/// How far the critic's estimates are known, as a share of their size.
const CHOICE_TOLERANCE: f64 = 1e-4;

/// Flies the golden trace's states and costs as the best of [`CHOICES`] and
/// asks the reference whether each action is a candidate that may win;
/// returns how many were.
fn choices(image: &PolicyImage<'_>, critic: &CriticReference) -> Result<usize, String> {
    let (golden, reference) = (&image.sections().golden, Reference::new(image));
    let limit = CostLimit::from_cost(golden.limit);
    let mut controller = host::pilot(image, limit, golden.seed, CHOICES as u8).map_err(|error| error.to_string())?;
    for (tick, row) in (0..).zip(golden.rows()) {
        let step = controller.step_within(row.state, row.incurred, usize::MAX);
        let Some(rung) = step.rung else { return Err(format!("golden state {tick}: no action")) };
        let asked = (critic, CHOICES as u32);
        let candidates = reference.candidates(asked, rung, row.state, step.kappa, [golden.seed, tick]);
        let estimates: Vec<Estimate> = candidates.iter().map(|(_, estimate)| *estimate).collect();
        let size = estimates.iter().fold(1.0f64, |size, one| size.max(one.reward.abs()).max(one.excess.abs()));
        let is_taken = |action: &[f64]| {
            let entries = step.action.iter().zip(action);
            entries.into_iter().all(|(taken, entry)| (f64::from(*taken) - entry).abs() <= reference.tolerance())
        };
        let may_win = |estimate: &Estimate| estimate.may_win(&estimates, CHOICE_TOLERANCE * size);
        if !candidates.iter().any(|(action, estimate)| is_taken(action) && may_win(estimate)) {
            return Err(format!("golden state {tick}: the action is not the best candidate"));
        }
    }
    Ok(golden.rows().len())
}

impl fmt::Display for Verification {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for check in &self.checks {
            let verdict = if check.passed { "pass" } else { "FAIL" };
            writeln!(f, "{verdict}  {:<24}{}", check.name, check.detail)?;
        }
        let (passed, all) = (self.checks.len() - self.failures(), self.checks.len());
        write!(f, "{passed} of {all} checks passed")
    }
}

#[cfg(test)]
mod tests;
