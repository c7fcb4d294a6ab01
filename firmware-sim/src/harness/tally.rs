//! What a flight counts, over control steps and episodes.

use std::fmt;

use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};

use super::record::{Decision, Notice, Record};
use crate::fault::FaultKind;

/// Counts over control steps.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Tally {
    /// Control steps.
    pub steps: u64,
    /// Undiscounted return.
    pub reward: f64,
    /// Undiscounted cost return.
    pub cost: f64,
    /// Control steps that ended with the policy's action, in order of [`Decision`] with those after it.
    pub policy: u64,
    /// Those in which the action before was held.
    pub held: u64,
    /// Those of the fallback.
    pub fallback: u64,
    /// Those with the controller down.
    pub down: u64,
    /// Control steps in which each fault struck.
    #[serde(serialize_with = "by_fault")]
    pub injected: [u64; FaultKind::ALL.len()],
    /// Control steps in which the firmware noticed each thing.
    #[serde(serialize_with = "by_notice")]
    pub noticed: [u64; Notice::ALL.len()],
    /// Control steps in which something was noticed.
    pub detected: u64,
    /// Actions beyond the policy's bounds that came to the actuators: must be none.
    pub actions_out_of_range: u64,
    /// Budgets that grew, or were above what was left: must be none.
    pub budget_errors: u64,
}

impl Tally {
    /// Counts a control step.
    pub(super) fn add(&mut self, record: &Record) {
        self.steps += 1;
        self.reward += record.reward;
        self.cost += record.cost;
        *match record.decision {
            Decision::Policy => &mut self.policy,
            Decision::Held => &mut self.held,
            Decision::Fallback => &mut self.fallback,
            Decision::Down => &mut self.down,
        } += 1;
        for kind in record.injected.iter() {
            self.injected[kind as usize] += 1;
        }
        for notice in record.noticed.iter() {
            self.noticed[notice as usize] += 1;
        }
        self.detected += u64::from(!record.noticed.is_empty());
    }

    /// Counts a boot after the last control step.
    pub(super) fn note_slot(&mut self, passed_over: bool) {
        self.noticed[Notice::Slot as usize] += u64::from(passed_over);
        self.detected += u64::from(passed_over);
    }

    /// How often a notice came.
    pub const fn notices(&self, notice: Notice) -> u64 {
        self.noticed[notice as usize]
    }

    /// Control steps in which each fault struck.
    pub fn injected_by_name(&self) -> impl Iterator<Item = (&'static str, u64)> {
        FaultKind::ALL.map(FaultKind::name).into_iter().zip(self.injected)
    }

    /// Control steps in which each thing was noticed.
    pub fn noticed_by_name(&self) -> impl Iterator<Item = (&'static str, u64)> {
        Notice::ALL.map(Notice::name).into_iter().zip(self.noticed)
    }

    /// Control steps in which a fault struck, summed over the faults.
    pub fn struck(&self) -> u64 {
        self.injected.iter().sum()
    }
}

impl std::iter::Sum for Tally {
    fn sum<I: Iterator<Item = Self>>(tallies: I) -> Self {
        tallies.fold(Self::default(), |a, b| Self {
            steps: a.steps + b.steps,
            reward: a.reward + b.reward,
            cost: a.cost + b.cost,
            policy: a.policy + b.policy,
            held: a.held + b.held,
            fallback: a.fallback + b.fallback,
            down: a.down + b.down,
            injected: std::array::from_fn(|i| a.injected[i] + b.injected[i]),
            noticed: std::array::from_fn(|i| a.noticed[i] + b.noticed[i]),
            detected: a.detected + b.detected,
            actions_out_of_range: a.actions_out_of_range + b.actions_out_of_range,
            budget_errors: a.budget_errors + b.budget_errors,
        })
    }
}

fn by_fault<S: Serializer>(counts: &[u64], serializer: S) -> Result<S::Ok, S::Error> {
    named(FaultKind::ALL.map(FaultKind::name).into_iter().zip(counts), serializer)
}

fn by_notice<S: Serializer>(counts: &[u64], serializer: S) -> Result<S::Ok, S::Error> {
    named(Notice::ALL.map(Notice::name).into_iter().zip(counts), serializer)
}

/// Counts under their names, without those of nothing.
fn named<'a, S: Serializer>(
    counts: impl Iterator<Item = (&'static str, &'a u64)>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut map = serializer.serialize_map(None)?;
    for (name, count) in counts.filter(|(_, count)| **count > 0) {
        map.serialize_entry(name, count)?;
    }
    map.end()
}

/// Text of at most 80 columns.
impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { policy, held, fallback, down, .. } = self;
        writeln!(f, "control steps       {policy:>10} by the policy, {held} held, {fallback} fallback, {down} down")?;
        let named = |counts: &mut dyn Iterator<Item = (&'static str, u64)>| {
            let words: Vec<String> =
                counts.filter(|(_, count)| *count > 0).map(|(name, count)| format!("{name} {count}")).collect();
            wrapped(&words)
        };
        for (what, words) in
            [("faults injected", named(&mut self.injected_by_name())), ("noticed", named(&mut self.noticed_by_name()))]
        {
            if !words.is_empty() {
                writeln!(f, "{what:<20}{words}")?;
            }
        }
        writeln!(f, "actions out of range{:>10}", self.actions_out_of_range)?;
        write!(f, "budget errors       {:>10}", self.budget_errors)
    }
}

/// Words in lines of 60 columns behind a margin of 20.
fn wrapped(words: &[String]) -> String {
    let mut text = String::new();
    let mut column = 0;
    for (index, word) in words.iter().enumerate() {
        let comma = if index + 1 < words.len() { "," } else { "" };
        if column + word.len() + 2 > 60 {
            text.push_str("\n                    ");
            column = 0;
        }
        if column > 0 {
            text.push(' ');
            column += 1;
        }
        text.push_str(word);
        text.push_str(comma);
        column += word.len() + comma.len();
    }
    text
}
