//! Replay of an image's own trace: the proof that this machine computes what
//! the exporting one computed.

use core::fmt;

use armor_core::image::{GoldenTrace, PolicyImage};
use armor_core::units::{Cost, CostLimit};

use crate::controller::Controller;
use crate::policy::{LoadError, Policy};

/// Where a controller and a golden trace part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GoldenError {
    /// The policy cannot fly on this controller at all.
    Load(LoadError),
    /// The trace has no rows; it would prove nothing.
    Empty,
    /// The budget differs.
    Kappa {
        /// Row of the trace, from 0.
        row: usize,
        /// The budget in the trace.
        expected: Cost,
        /// The budget of this controller.
        actual: Cost,
    },
    /// An action differs in at least one bit.
    Action {
        /// Row of the trace, from 0.
        row: usize,
        /// Entry of the action, from 0.
        entry: usize,
        /// The entry in the trace.
        expected: f32,
        /// The entry that this controller computed.
        actual: f32,
    },
}

impl fmt::Display for GoldenError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Load(error) => error.fmt(f),
            Self::Empty => f.write_str("the image has no golden trace; export it again"),
            Self::Kappa { row, expected, actual } => write!(
                f,
                "golden trace, row {row}: the budget is {actual} and not {expected}; image and controller do not match, do not fly"
            ),
            Self::Action { row, entry, expected, actual } => write!(
                f,
                "golden trace, row {row}: action entry {entry} is {actual:e} ({:#010x}) and not {expected:e} ({:#010x}); image and controller do not match, do not fly",
                actual.to_bits(),
                expected.to_bits()
            ),
        }
    }
}

impl core::error::Error for GoldenError {}

impl From<LoadError> for GoldenError {
    fn from(error: LoadError) -> Self {
        Self::Load(error)
    }
}

/// Flies the golden trace of `image` on a fresh controller and compares every
/// budget and action bit for bit; returns the number of rows.
///
/// # Errors
/// [`GoldenError`], at the first row that differs.
pub fn replay<const STATE: usize, const ACTION: usize, const HIDDEN: usize>(
    image: &PolicyImage<'_>,
) -> Result<usize, GoldenError> {
    let trace = &image.sections().golden;
    let policy = Policy::load(image)?;
    let mut controller =
        Controller::<STATE, ACTION, HIDDEN>::new(policy, CostLimit::from_cost(trace.limit), trace.seed)?;
    replay_on(&mut controller, trace)
}

/// As [`replay`], on a controller of the same image that is there already and
/// starts a new episode: for firmware without the memory of a second one.
///
/// # Errors
/// [`GoldenError`], at the first row that differs.
pub fn replay_on<const STATE: usize, const ACTION: usize, const HIDDEN: usize>(
    controller: &mut Controller<'_, STATE, ACTION, HIDDEN>,
    trace: &GoldenTrace<'_>,
) -> Result<usize, GoldenError> {
    let rows = trace.rows().len();
    if rows == 0 {
        return Err(GoldenError::Empty);
    }
    controller.new_episode(CostLimit::from_cost(trace.limit), trace.seed)?;
    for (row, expected) in trace.rows().enumerate() {
        let step = controller.step(expected.state, expected.incurred);
        if step.kappa != expected.kappa {
            return Err(GoldenError::Kappa { row, expected: expected.kappa, actual: step.kappa });
        }
        for (entry, (&actual, &expected)) in step.action.iter().zip(expected.action).enumerate() {
            if actual.to_bits() != expected.to_bits() {
                return Err(GoldenError::Action { row, entry, expected, actual });
            }
        }
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{Fixture, Parts, SMALL};
    use armor_core::image::SectionKind;

    const ROWS: usize = 4;

    /// A random policy with a trace that ends with a spent budget and a fault.
    fn recorded() -> Parts {
        let mut parts = Fixture::random(SMALL, 4);
        let states = [[0.5; 3], [-1.0; 3], [2.0, -3.0, 0.0], [f32::NAN; 3]];
        parts.record_golden(CostLimit::new(2.0).unwrap(), 77, &states, &[0.0, 0.5, 1.0, 3.0]);
        parts
    }

    fn outcome(parts: Parts) -> Result<usize, GoldenError> {
        replay::<8, 4, 16>(&parts.build().image())
    }

    #[test]
    fn a_trace_of_the_controller_replays() {
        assert_eq!(outcome(recorded()), Ok(ROWS));
    }

    #[test]
    fn any_flipped_bit_of_an_expected_kappa_or_action_is_found_at_its_row() {
        let row_words = GoldenTrace::row_words(SMALL.state.into(), SMALL.action.into());
        for row in 0..ROWS {
            for word in usize::from(SMALL.state) + 1..row_words {
                for bit in 0..32 {
                    let mut parts = recorded();
                    parts.section(SectionKind::Golden)[GoldenTrace::HEADER_WORDS + row * row_words + word] ^= 1 << bit;
                    let found = match outcome(parts) {
                        Err(GoldenError::Kappa { row, .. }) => (row, 0),
                        Err(GoldenError::Action { row, entry, .. }) => (row, 1 + entry),
                        other => panic!("row {row}, word {word}, bit {bit}: {other:?}"),
                    };
                    assert_eq!(found, (row, word - usize::from(SMALL.state) - 1));
                }
            }
        }
    }

    #[test]
    fn a_trace_without_rows_proves_nothing() {
        assert_eq!(outcome(Fixture::random(SMALL, 4)), Err(GoldenError::Empty));
    }

    #[test]
    fn a_policy_that_does_not_fit_is_named() {
        let fixture = recorded().build();
        let error = LoadError::StateCapacity { needed: 3, capacity: 2 };
        assert_eq!(replay::<2, 4, 16>(&fixture.image()), Err(GoldenError::Load(error)));
    }
}
