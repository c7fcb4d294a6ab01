//! How the 8-bit weights of an integer policy lie in its image.

use serde::{Deserialize, Serialize};

/// The order of the weights of an integer matrix. The weights are the same in
/// both, and so is every sum over them; machines differ in which they read faster.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// Row after row, an output's inputs side by side: for vectors of bytes
    /// (x86-64, Cortex-M55) and for plain loops.
    #[default]
    Rows,
    /// Blocks of 4 rows and 4 columns, two rows in the bytes of each half-word:
    /// for the 16-bit SIMD of a Cortex-M4, M7 or M33 (SMLAD).
    ///
    /// The half-word of rows `l` (even) and `h = l + 1` in one column is
    /// `256 w[h] + (w[l] + 128)`, a signed and an unsigned byte. So one product
    /// with the half-word and one with its low byte make the sums of both rows.
    Paired,
}

impl Layout {
    /// Rows and columns of a block of [`Layout::Paired`].
    pub const BLOCK: usize = 4;

    /// Bytes of a matrix; paired, rows and columns are filled up to whole blocks.
    pub const fn bytes(self, rows: usize, columns: usize) -> usize {
        match self {
            Self::Rows => rows * columns,
            Self::Paired => rows.next_multiple_of(Self::BLOCK) * columns.next_multiple_of(Self::BLOCK),
        }
    }

    /// Where the weight of a row and column lies, in bytes from the start of a matrix of `columns`.
    pub const fn place(self, row: usize, column: usize, columns: usize) -> usize {
        const N: usize = Layout::BLOCK;
        match self {
            Self::Rows => row * columns + column,
            Self::Paired => {
                let block = row / N * columns.div_ceil(N) + column / N;
                N * N * block + 2 * N * (row % N / 2) + 2 * (column % N) + row % 2
            }
        }
    }

    /// The byte that a weight of a row is stored as, and the other way round.
    pub const fn byte(self, row: usize, weight: i8) -> i8 {
        match self {
            Self::Paired if row.is_multiple_of(2) => weight ^ i8::MIN,
            Self::Rows | Self::Paired => weight,
        }
    }

    /// Lays out a matrix whose weights are given row after row, and fills its
    /// blocks up with weights of 0. `out` has [`Layout::bytes`]; what a shorter
    /// one cannot hold is left out.
    pub fn arrange(self, weights: &[i8], columns: usize, out: &mut [i8]) {
        let rows = weights.len() / columns.max(1);
        let whole = |count: usize| if self == Self::Paired { count.next_multiple_of(Self::BLOCK) } else { count };
        for row in 0..whole(rows) {
            for column in 0..whole(columns) {
                let weight = (column < columns).then(|| weights.get(row * columns + column)).flatten();
                if let Some(byte) = out.get_mut(self.place(row, column, columns)) {
                    *byte = self.byte(row, weight.copied().unwrap_or_default());
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec;
    use std::vec::Vec;

    #[test]
    fn a_block_of_pairs_byte_by_byte() {
        // Weight 10 r + c in row r and column c; the last row and the last two columns are filled up.
        let weights = [0, 1, 10, 11, 20, 21];
        let mut bytes = [1; 16];
        Layout::Paired.arrange(&weights, 2, &mut bytes);
        let low = |weight: i8| weight ^ -128;
        let pairs = [[low(0), 10], [low(1), 11], [low(0), 0], [low(0), 0], [low(20), 0], [low(21), 0]];
        assert_eq!(bytes[..12], *pairs.as_flattened());
        assert_eq!(bytes[12..], [low(0), 0, low(0), 0]);
    }

    #[test]
    fn a_half_word_is_a_signed_row_over_an_unsigned_one() {
        for (low, high) in [(0, 0), (-128, -128), (127, 127), (-1, 5), (100, -100)] {
            let bytes = [Layout::Paired.byte(0, low), Layout::Paired.byte(1, high)];
            let half_word = i16::from_le_bytes(bytes.map(|byte| byte as u8));
            assert_eq!(i32::from(half_word), 256 * i32::from(high) + i32::from(low) + 128);
        }
    }

    proptest! {
        #[test]
        fn every_weight_has_a_place_of_its_own(rows in 0usize..14, columns in 1usize..14, seed in any::<i8>()) {
            let weights: Vec<i8> = (0..rows * columns).map(|i| (i as i8).wrapping_mul(37).wrapping_add(seed)).collect();
            for layout in [Layout::Rows, Layout::Paired] {
                let mut bytes = vec![0; layout.bytes(rows, columns)];
                layout.arrange(&weights, columns, &mut bytes);
                let mut places: Vec<usize> = Vec::new();
                for row in 0..rows {
                    for column in 0..columns {
                        let place = layout.place(row, column, columns);
                        prop_assert_eq!(layout.byte(row, bytes[place]), weights[row * columns + column]);
                        places.push(place);
                    }
                }
                places.sort();
                places.dedup();
                prop_assert_eq!(places.len(), rows * columns);
            }
        }
    }
}
