//! Matrix products by `matrixmultiply`, the crate that nalgebra itself uses
//! for large products, over pieces of parameter vectors and their transposes.
//!
//! nalgebra's own `gemm` is not used: in its path for small matrices it reads
//! transposed views through a slice that is shorter than the view.

use nalgebra::DMatrix;

use super::Scalar;

/// A matrix to be read, with any strides.
#[derive(Clone, Copy)]
pub struct Operand<'a, T> {
    values: &'a [T],
    rows: usize,
    columns: usize,
    row_stride: usize,
    column_stride: usize,
}

impl<'a, T> Operand<'a, T> {
    /// `values` as a `rows x columns` matrix, column by column.
    ///
    /// # Panics
    /// Unless there are `rows * columns` values.
    pub fn new(values: &'a [T], rows: usize, columns: usize) -> Self {
        assert_eq!(values.len(), rows * columns, "a matrix has rows times columns values");
        Self { values, rows, columns, row_stride: 1, column_stride: rows }
    }

    /// The first columns of a matrix.
    ///
    /// # Panics
    /// Unless there are so many.
    pub fn leading(matrix: &'a DMatrix<T>, columns: usize) -> Self {
        Self::new(&matrix.as_slice()[..matrix.nrows() * columns], matrix.nrows(), columns)
    }

    /// The columns of a matrix that is not transposed.
    pub(super) fn columns(self) -> std::slice::ChunksExact<'a, T> {
        self.values.chunks_exact(self.rows)
    }

    /// The transpose, without moving a number.
    pub fn transposed(self) -> Self {
        Self {
            rows: self.columns,
            columns: self.rows,
            row_stride: self.column_stride,
            column_stride: self.row_stride,
            ..self
        }
    }
}

impl<'a, T: Scalar> From<&'a DMatrix<T>> for Operand<'a, T> {
    fn from(matrix: &'a DMatrix<T>) -> Self {
        Self::new(matrix.as_slice(), matrix.nrows(), matrix.ncols())
    }
}

/// What becomes of the numbers that a product is written over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Update {
    /// They are replaced.
    Replace,
    /// The product is added to them.
    Add,
}

/// Writes `a b` to `out`, column by column.
///
/// # Panics
/// Unless the dimensions fit.
#[allow(unsafe_code)] // The one call into `matrixmultiply`; its bounds are checked here.
pub fn product<T: Scalar>(out: &mut [T], a: Operand<'_, T>, b: Operand<'_, T>, update: Update) {
    assert_eq!(a.columns, b.rows, "inner dimensions agree");
    assert_eq!(out.len(), a.rows * b.columns, "the result has rows times columns values");
    let beta = match update {
        Update::Replace => T::zero(),
        Update::Add => T::one(),
    };
    // SAFETY: `Operand::new` and `transposed` keep `(rows - 1) * row_stride + (columns - 1) *
    // column_stride < values.len()`, and `out` holds `a.rows * b.columns` values.
    unsafe {
        T::gemm(
            [a.rows, a.columns, b.columns],
            (a.values.as_ptr(), [a.row_stride as isize, a.column_stride as isize]),
            (b.values.as_ptr(), [b.row_stride as isize, b.column_stride as isize]),
            beta,
            (out.as_mut_ptr(), [1, a.rows as isize]),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::fill;

    #[test]
    fn products_and_transposes_are_those_of_nalgebra() {
        for [m, k, n] in [[1, 1, 1], [2, 3, 5], [1, 7, 4], [33, 17, 65]] {
            let a = DMatrix::from_vec(m, k, fill(m * k, 1));
            let b = DMatrix::from_vec(k, n, fill(k * n, 2));
            let expected = &a * &b;
            let (a_t, b_t) = (a.transpose(), b.transpose());
            for (a, b) in [
                (Operand::from(&a), Operand::from(&b)),
                (Operand::from(&a_t).transposed(), Operand::from(&b)),
                (Operand::from(&a), Operand::from(&b_t).transposed()),
            ] {
                let mut out = DMatrix::from_element(m, n, f64::NAN);
                product(out.as_mut_slice(), a, b, Update::Replace);
                assert!((&out - &expected).amax() < 1e-12);
                product(out.as_mut_slice(), a, b, Update::Add);
                assert!((&out - 2.0 * &expected).amax() < 1e-12);
            }
        }
    }
}
