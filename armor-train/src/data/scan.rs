//! What must hold for the values of a recording.

use armor_core::units::Cost;

use super::error::Fault;
use super::key::Key;

/// How far an action may lie beyond `[-1, 1]` and still be taken for a rounding
/// error that clipping mends (O-4); one part in a thousand of the bound.
const ACTION_TOLERANCE: f32 = 1e-3;

/// Looks at the values of one data set, block after block, and keeps at most one fault of each kind.
pub(super) struct Scan {
    key: Key,
    not_finite: Option<Found>,
    out_of_range: Option<Found>,
}

/// The first bad value of a kind, and how many there are.
struct Found {
    row: usize,
    value: f32,
    count: usize,
}

impl Scan {
    pub(super) const fn new(key: Key) -> Self {
        Self { key, not_finite: None, out_of_range: None }
    }

    /// Looks at whole rows of `width` values, the first of them row `first`.
    pub(super) fn look(&mut self, first: usize, width: usize, values: &[f32]) {
        let in_range = match self.key {
            Key::Observations | Key::NextObservations | Key::Rewards => |_| true,
            Key::Actions => is_action,
            Key::Costs => is_cost,
            Key::Terminals | Key::Timeouts => is_flag,
        };
        for (place, &value) in values.iter().enumerate() {
            let slot = if !value.is_finite() {
                &mut self.not_finite
            } else if !in_range(value) {
                &mut self.out_of_range
            } else {
                continue;
            };
            slot.get_or_insert(Found { row: first + place / width, value, count: 0 }).count += 1;
        }
    }

    /// The faults of what was looked at.
    pub(super) fn faults(self) -> impl Iterator<Item = Fault> {
        let key = self.key;
        let not_finite = self.not_finite.map(|Found { row, count, .. }| Fault::NotFinite { key, row, count });
        let out_of_range = self.out_of_range.map(|Found { row, value, count }| match key {
            Key::Costs => Fault::CostOutOfRange { row, value, count },
            Key::Actions => Fault::ActionOutOfRange { row, value, count },
            _ => Fault::InvalidFlag { key, row, value, count },
        });
        not_finite.into_iter().chain(out_of_range)
    }
}

/// Whether the controller's budget can count it.
fn is_cost(value: f32) -> bool {
    (0.0..=Cost::MAX.to_f32()).contains(&value)
}

fn is_action(value: f32) -> bool {
    value.abs() <= 1.0 + ACTION_TOLERANCE
}

fn is_flag(value: f32) -> bool {
    value == 0.0 || value == 1.0
}
