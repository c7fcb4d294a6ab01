//! Matrix products over pieces of parameter vectors and their transposes.

use std::slice::SliceIndex;

use nalgebra::DMatrix;

use super::kernel::{self, ROWS};
use super::{Ahead, Scalar};

/// A matrix to be read: stored column by column, or the transpose of one that is.
#[derive(Clone, Copy)]
pub struct Operand<'a, T> {
    values: &'a [T],
    /// Length of a stored column.
    stride: usize,
    /// Number of stored columns.
    count: usize,
    transposed: bool,
}

impl<'a, T> Operand<'a, T> {
    /// `values` as a `rows x columns` matrix, column by column.
    ///
    /// # Panics
    /// Unless there are `rows * columns` values.
    pub fn new(values: &'a [T], rows: usize, columns: usize) -> Self {
        assert_eq!(values.len(), rows * columns, "a matrix has rows times columns values");
        Self { values, stride: rows, count: columns, transposed: false }
    }

    /// The first columns of a matrix.
    ///
    /// # Panics
    /// Unless there are so many.
    pub fn leading(matrix: &'a DMatrix<T>, columns: usize) -> Self {
        Self::new(&matrix.as_slice()[..matrix.nrows() * columns], matrix.nrows(), columns)
    }

    /// The transpose, without moving a number.
    pub fn transposed(self) -> Self {
        Self { transposed: !self.transposed, ..self }
    }

    pub(super) const fn rows(&self) -> usize {
        if self.transposed { self.count } else { self.stride }
    }

    pub(super) const fn columns(&self) -> usize {
        if self.transposed { self.stride } else { self.count }
    }

    pub(super) const fn is_transposed(&self) -> bool {
        self.transposed
    }

    /// All numbers, in the order in which they are stored.
    pub(crate) const fn values(&self) -> &'a [T] {
        self.values
    }

    /// Distance in storage from a row to the next, and from a column to the next.
    pub(super) const fn strides(&self) -> [usize; 2] {
        if self.transposed { [self.stride, 1] } else { [1, self.stride] }
    }

    /// The columns as they are stored: the rows of a transpose.
    pub(super) fn stored_columns(self) -> std::slice::ChunksExact<'a, T> {
        self.values.chunks_exact(self.stride)
    }

    pub(super) fn stored_column(self, index: usize) -> &'a [T] {
        &self.values[index * self.stride..(index + 1) * self.stride]
    }
}

impl<'a, T: Scalar> From<&'a DMatrix<T>> for Operand<'a, T> {
    fn from(matrix: &'a DMatrix<T>) -> Self {
        Self::new(matrix.as_slice(), matrix.nrows(), matrix.ncols())
    }
}

/// What a product does with the numbers that it is written over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Update<'a, T> {
    /// They are replaced by it.
    Replace,
    /// It is added to them.
    Add,
    /// They are multiplied by it, entry by entry.
    Multiply,
    /// They are replaced by its sum with another matrix, as large and stored alike.
    Plus(&'a [T]),
    /// They are replaced by it, multiplied entry by entry with another matrix.
    Times(&'a [T]),
}

impl<T> Update<'_, T> {
    /// What holds for some of the numbers.
    #[inline(always)]
    pub(super) fn within(self, range: impl SliceIndex<[T], Output = [T]>) -> Self {
        match self {
            Self::Replace => Self::Replace,
            Self::Add => Self::Add,
            Self::Multiply => Self::Multiply,
            Self::Plus(other) => Self::Plus(&other[range]),
            Self::Times(other) => Self::Times(&other[range]),
        }
    }
}

/// A left factor of many products, copied into the order in which they read it.
#[derive(Clone, Debug)]
pub(super) struct Packed<T> {
    rows: usize,
    depth: usize,
    /// Panels of [`ROWS`] rows, one after the other; in a panel the columns follow each other.
    panels: Vec<[T; ROWS]>,
}

impl<T: Scalar> Packed<T> {
    /// A copy of `matrix`.
    pub(super) fn new(matrix: Operand<'_, T>) -> Self {
        let (rows, depth) = (matrix.rows(), matrix.columns());
        let mut panels = Vec::with_capacity(rows.div_ceil(ROWS) * depth);
        for first in (0..rows).step_by(ROWS) {
            append_panel(&mut panels, matrix, first);
        }
        Self { rows, depth, panels }
    }

    #[cfg(test)]
    pub(super) fn panels(&self) -> &[[T; ROWS]] {
        &self.panels
    }

    /// Writes the product of the packed matrix and `b` to `out`, column by column, and may fetch what is `ahead`.
    ///
    /// # Panics
    /// Unless the dimensions fit.
    pub(super) fn multiply(&self, out: &mut [T], b: Operand<'_, T>, update: Update<'_, T>, ahead: &Ahead) {
        check(out, [self.rows, self.depth], b, update);
        T::multiply(out, self.rows, &self.panels, b, update, ahead);
    }
}

/// Writes `a b` to `out`, column by column.
///
/// # Panics
/// Unless the dimensions fit.
pub fn product<T: Scalar>(out: &mut [T], a: Operand<'_, T>, b: Operand<'_, T>, update: Update<'_, T>) {
    product_fetching(out, a, b, update, Ahead::nothing());
}

/// [`product`], which meanwhile may fetch what is `ahead`.
///
/// # Panics
/// As [`product`].
pub(super) fn product_fetching<T: Scalar>(
    out: &mut [T],
    a: Operand<'_, T>,
    b: Operand<'_, T>,
    update: Update<'_, T>,
    ahead: &Ahead,
) {
    check(out, [a.rows(), a.columns()], b, update);
    if a.rows() < ROWS && b.is_transposed() && b.columns() >= ROWS {
        turned_product(out, a, b, update);
    } else {
        T::product(out, a, b, update, ahead);
    }
}

/// [`product`] as the transpose of `b^T a^T`, with the same bits: where `a` has few rows they
/// would leave most of a panel empty.
fn turned_product<T: Scalar>(out: &mut [T], a: Operand<'_, T>, b: Operand<'_, T>, update: Update<'_, T>) {
    let (rows, columns) = (a.rows(), b.columns());
    let mut turned = vec![T::zero(); out.len()];
    T::product(&mut turned, b.transposed(), a.transposed(), Update::Replace, Ahead::nothing());
    let mut sums = [T::zero(); ROWS];
    for (column, out) in out.chunks_exact_mut(rows).enumerate() {
        for (row, sum) in sums[..rows].iter_mut().enumerate() {
            *sum = turned[row * columns + column];
        }
        kernel::store(out, &sums, update.within(column * rows..));
    }
}

fn check<T>(out: &[T], [rows, depth]: [usize; 2], b: Operand<'_, T>, update: Update<'_, T>) {
    assert_eq!(depth, b.rows(), "inner dimensions agree");
    assert_eq!(out.len(), rows * b.columns(), "the result has rows times columns values");
    if let Update::Plus(other) | Update::Times(other) = update {
        assert_eq!(other.len(), out.len(), "the other matrix is as large as the result");
    }
}

/// Copies the rows from `first` on, filled up with zeros, to the end of `panels`.
fn append_panel<T: Scalar>(panels: &mut Vec<[T; ROWS]>, matrix: Operand<'_, T>, first: usize) {
    let height = ROWS.min(matrix.rows() - first);
    if matrix.transposed {
        // Block by block: a row of a block lies in one line of the cache, and so does a row of a panel.
        for start in (0..matrix.columns()).step_by(ROWS) {
            let depth = ROWS.min(matrix.columns() - start);
            let mut block = [[T::zero(); ROWS]; ROWS];
            for (row, column) in block.iter_mut().zip(first..first + height) {
                let values = &matrix.stored_column(column)[start..];
                match values.first_chunk() {
                    Some(values) => *row = *values,
                    None => row[..depth].copy_from_slice(values),
                }
            }
            T::transpose(&mut block);
            panels.extend_from_slice(&block[..depth]);
        }
    } else {
        panels.extend(matrix.stored_columns().map(|column| match column[first..].first_chunk() {
            Some(&rows) => rows,
            None => std::array::from_fn(|row| if row < height { column[first + row] } else { T::zero() }),
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::fill;

    #[test]
    fn products_and_transposes_are_those_of_nalgebra() {
        for [m, k, n] in [[1, 1, 1], [2, 3, 5], [1, 7, 4], [16, 5, 6], [33, 17, 65]] {
            let a = DMatrix::from_vec(m, k, fill(m * k, 1));
            let b = DMatrix::from_vec(k, n, fill(k * n, 2));
            let expected = &a * &b;
            let (a_t, b_t) = (a.transpose(), b.transpose());
            for (a, b) in [
                (Operand::from(&a), Operand::from(&b)),
                (Operand::from(&a_t).transposed(), Operand::from(&b)),
                (Operand::from(&a), Operand::from(&b_t).transposed()),
                (Operand::from(&a_t).transposed(), Operand::from(&b_t).transposed()),
            ] {
                let mut out = DMatrix::from_element(m, n, f64::NAN);
                product(out.as_mut_slice(), a, b, Update::Replace);
                assert!((&out - &expected).amax() < 1e-12);
                Packed::new(a).multiply(out.as_mut_slice(), b, Update::Add, Ahead::nothing());
                assert!((&out - 2.0 * &expected).amax() < 1e-12);
            }
        }
    }
}
