//! The golden trace: an episode that the controller must reproduce bit for bit.
//!
//! Words: seed low, seed high, cost limit (raw), number of rows; then a row a
//! step: state `[S]`, incurred cost (f32), kappa after the charge (raw), action `[A]`.

use super::{ImageError, SectionKind};
use crate::units::Cost;

/// A recorded episode of the controller.
#[derive(Clone, Copy, Debug)]
pub struct GoldenTrace<'a> {
    /// Seed of the controller's noise.
    pub seed: u64,
    /// Cost limit of the episode.
    pub limit: Cost,
    rows: &'a [u32],
    state: usize,
    action: usize,
}

/// One step of a golden trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GoldenRow<'a> {
    /// What the sensors said `[S]`.
    pub state: &'a [f32],
    /// The cost that the step before incurred.
    pub incurred: f32,
    /// The budget left after it.
    pub kappa: Cost,
    /// The action that the controller must answer `[A]`.
    pub action: &'a [f32],
}

impl<'a> GoldenTrace<'a> {
    /// Words in front of the rows.
    pub const HEADER_WORDS: usize = 4;

    /// Words of a row.
    pub const fn row_words(state: usize, action: usize) -> usize {
        state + 2 + action
    }

    pub(super) fn read(words: &'a [u32], state: usize, action: usize) -> Result<Self, ImageError> {
        let error = ImageError::Section(SectionKind::Golden);
        let (&[low, high, limit, count], rows) = words.split_first_chunk().ok_or(error)?;
        let expected = (count as usize).checked_mul(Self::row_words(state, action));
        if expected != Some(rows.len()) {
            return Err(error);
        }
        Ok(Self { seed: u64::from(high) << 32 | u64::from(low), limit: Cost::from_raw(limit), rows, state, action })
    }

    /// The steps of the episode.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = GoldenRow<'a>> + use<'a> {
        let (state, action) = (self.state, self.action);
        // A row has at least two words; `max` tells the compiler, which else keeps a panic.
        self.rows.chunks_exact(Self::row_words(state, action).max(2)).map(move |row| {
            let (state, rest) = row.split_at_checked(state).unwrap_or_default();
            let (&[incurred, kappa], action) = rest.split_first_chunk().unwrap_or((&[0, 0], &[]));
            GoldenRow {
                state: bytemuck::try_cast_slice(state).unwrap_or_default(),
                incurred: f32::from_bits(incurred),
                kappa: Cost::from_raw(kappa),
                action: bytemuck::try_cast_slice(action).unwrap_or_default(),
            }
        })
    }
}
