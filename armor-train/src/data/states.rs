//! The states of a recording, each kept once.

/// Observations and next observations of all rows.
///
/// A next observation that is the observation of the row after, bit for bit, is
/// not kept a second time: of a recorded episode only the last one is.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct States {
    width: usize,
    /// Row-major, `N * S`.
    observations: Vec<f32>,
    /// In ascending order, the rows whose next observation is kept here, in `others`.
    breaks: Vec<usize>,
    others: Vec<f32>,
}

impl States {
    /// Observations of `width` entries, row-major, still without the next ones.
    pub(super) const fn new(width: usize, observations: Vec<f32>) -> Self {
        Self { width, observations, breaks: Vec::new(), others: Vec::new() }
    }

    /// Takes in the next observation of `row`; rows come in ascending order.
    pub(super) fn push_next(&mut self, row: usize, next: &[f32]) {
        let after = (row + 1) * self.width;
        let follows = self.observations.get(after..after + self.width).is_some_and(|state| same_bits(state, next));
        if !follows {
            self.breaks.push(row);
            self.others.extend_from_slice(next);
        }
    }

    /// Entries of a state.
    pub(super) const fn width(&self) -> usize {
        self.width
    }

    /// The state before the action.
    pub(super) fn observation(&self, row: usize) -> &[f32] {
        &self.observations[row * self.width..(row + 1) * self.width]
    }

    /// The state after the action, as recorded.
    pub(super) fn next_observation(&self, row: usize) -> &[f32] {
        match self.breaks.binary_search(&row) {
            Ok(place) => &self.others[place * self.width..(place + 1) * self.width],
            Err(_) => self.observation(row + 1),
        }
    }

    /// The rows whose next observation is not the observation of the row after, in ascending order.
    pub(super) fn breaks(&self) -> &[usize] {
        &self.breaks
    }
}

fn same_bits(a: &[f32], b: &[f32]) -> bool {
    a.iter().map(|x| x.to_bits()).eq(b.iter().map(|x| x.to_bits()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_next_state_is_kept_only_where_it_is_not_the_next_rows_bit_for_bit() {
        let mut states = States::new(2, vec![0.0, 0.0, 1.0, 0.0, 2.0, 0.0]);
        let nexts = [[1.0, 0.0], [2.0, -0.0], [3.0, 0.0]];
        for (row, next) in nexts.iter().enumerate() {
            states.push_next(row, next);
        }
        assert_eq!(states.breaks(), [1, 2]);
        assert_eq!(states.others.len(), 4);
        for (row, next) in nexts.iter().enumerate() {
            assert_eq!(states.observation(row), [row as f32, 0.0]);
            assert!(same_bits(states.next_observation(row), next));
        }
    }
}
