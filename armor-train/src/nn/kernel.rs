//! The inner loops of all matrix products, in safe Rust that vectorises.
//!
//! A product is computed tile by tile: `ROWS x COLUMNS` sums stay in registers
//! while the inner dimension passes by. The left factor lies in panels of `ROWS`
//! rows, so that its numbers are read in the order in which they are used; the
//! right factor is read where it is.
//!
//! Every sum runs over the inner dimension in order, one fused multiply-add
//! after the other: the bits depend neither on the width of the vectors nor on
//! the place of an entry. CPUs without fused multiply-add round twice, so their
//! bits differ.

#[cfg(target_arch = "x86_64")]
mod avx512;

use multiversion::multiversion;
use multiversion::target::target_cfg_f;

use super::product::{Operand, Packed, Update};
use super::{Ahead, Scalar};

/// Rows of a tile: two vectors of eight f32.
pub(super) const ROWS: usize = 16;
/// Columns of a tile: with two vectors each they fill 12 of 16 vector registers.
pub(super) const COLUMNS: usize = 6;

/// The sums of one tile: `a`, row by row of the inner dimension, times `b` likewise.
#[inline(always)]
fn tile<T: Scalar>(
    a: &[[T; ROWS]],
    b: impl Iterator<Item = [T; COLUMNS]>,
    multiply_add: impl Fn(T, T, T) -> T,
) -> [[T; ROWS]; COLUMNS] {
    let mut sums = [[T::zero(); ROWS]; COLUMNS];
    for (a, b) in a.iter().zip(b) {
        for column in 0..COLUMNS {
            for row in 0..ROWS {
                sums[column][row] = multiply_add(a[row], b[column], sums[column][row]);
            }
        }
    }
    sums
}

/// Writes the product of a left factor of `rows` rows, in panels, and of `b` to `out`.
#[inline(always)]
pub(super) fn multiply<T: Scalar>(
    out: &mut [T],
    rows: usize,
    panels: &[[T; ROWS]],
    b: Operand<'_, T>,
    update: Update<'_, T>,
    multiply_add: impl Fn(T, T, T) -> T + Copy,
) {
    for panel in 0..rows.div_ceil(ROWS) {
        let (first, place) = (panel * ROWS, panel * b.rows());
        multiply_panel(out, (first, rows), &panels[place..place + b.rows()], b, update, multiply_add);
    }
}

/// Writes the product of a panel of the left factor and all of `b` to `out`'s
/// rows from `first` on; `out` has `rows` rows.
#[inline(always)]
fn multiply_panel<T: Scalar>(
    out: &mut [T],
    (first, rows): (usize, usize),
    panel: &[[T; ROWS]],
    b: Operand<'_, T>,
    update: Update<'_, T>,
    multiply_add: impl Fn(T, T, T) -> T + Copy,
) {
    for (group, out) in out.chunks_mut(rows * COLUMNS).enumerate() {
        let at = group * COLUMNS;
        let sums = if !b.is_transposed() {
            let [b0, b1, b2, b3, b4, b5] =
                std::array::from_fn(|column| b.stored_column((at + column).min(b.columns() - 1)));
            let rows = b0.iter().zip(b1).zip(b2).zip(b3).zip(b4).zip(b5);
            tile(panel, rows.map(|(((((&b0, &b1), &b2), &b3), &b4), &b5)| [b0, b1, b2, b3, b4, b5]), multiply_add)
        } else if at + COLUMNS <= b.columns() {
            let rows = b.stored_columns().map(|row| *row[at..].first_chunk().expect("the group lies within the row"));
            tile(panel, rows, multiply_add)
        } else {
            // A narrow last group repeats the last column.
            let rows =
                b.stored_columns().map(|row| std::array::from_fn(|column| row[(at + column).min(row.len() - 1)]));
            tile(panel, rows, multiply_add)
        };
        for (column, (out, sums)) in (at..).zip(out.chunks_exact_mut(rows).zip(&sums)) {
            store(&mut out[first..], sums, update.within(column * rows + first..));
        }
    }
}

/// Puts the sums of a column in their place; `out` ends where the column does.
#[inline(always)]
pub(super) fn store<T: Scalar>(out: &mut [T], sums: &[T; ROWS], update: Update<'_, T>) {
    // A whole panel's height is known when this is compiled.
    match out.first_chunk_mut::<ROWS>() {
        Some(out) => store_rows(out, sums, update),
        None => store_rows(out, sums, update),
    }
}

#[inline(always)]
fn store_rows<T: Scalar>(out: &mut [T], sums: &[T; ROWS], update: Update<'_, T>) {
    let out = out.iter_mut().zip(sums);
    match update {
        Update::Replace => out.for_each(|(out, &sum)| *out = sum),
        Update::Add => out.for_each(|(out, &sum)| *out += sum),
        Update::Multiply => out.for_each(|(out, &sum)| *out *= sum),
        Update::Plus(other) => out.zip(other).for_each(|((out, &sum), &other)| *out = other + sum),
        Update::Times(other) => out.zip(other).for_each(|((out, &sum), &other)| *out = other * sum),
    }
}

/// [`multiply`] in f32, by the widest vectors of this processor.
pub(super) fn multiply_f32(
    out: &mut [f32],
    rows: usize,
    panels: &[[f32; ROWS]],
    b: Operand<'_, f32>,
    update: Update<'_, f32>,
    ahead: &Ahead,
) {
    #[cfg(target_arch = "x86_64")]
    if let Some(kernel) = avx512::Avx512::detect() {
        return kernel.multiply(out, rows, panels, b, update, ahead);
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = ahead;
    multiply_safely(out, rows, panels, b, update);
}

/// As [`multiply_f32`], with the left factor as it lies, if that saves a copy.
pub(super) fn product_f32(
    out: &mut [f32],
    a: Operand<'_, f32>,
    b: Operand<'_, f32>,
    update: Update<'_, f32>,
    ahead: &Ahead,
) {
    #[cfg(target_arch = "x86_64")]
    if let Some(kernel) = avx512::Avx512::detect().filter(|_| !a.is_transposed()) {
        return kernel.product(out, a, b, update, ahead);
    }
    Packed::new(a).multiply(out, b, update, ahead);
}

/// Exchanges rows and columns of a block.
pub(super) fn transpose<T: Scalar>(block: &mut [[T; ROWS]; ROWS]) {
    *block = std::array::from_fn(|column| block.map(|row| row[column]));
}

/// [`transpose`] in f32, by the widest vectors of this processor.
pub(super) fn transpose_f32(block: &mut [[f32; ROWS]; ROWS]) {
    #[cfg(target_arch = "x86_64")]
    if let Some(kernel) = avx512::Avx512::detect() {
        return kernel.transpose(block);
    }
    transpose(block);
}

/// [`multiply`] in f32, compiled for AVX2 as well and chosen at run time.
#[multiversion(targets("x86_64+avx2+fma"))]
fn multiply_safely(out: &mut [f32], rows: usize, panels: &[[f32; ROWS]], b: Operand<'_, f32>, update: Update<'_, f32>) {
    if target_cfg_f!(any(target_feature = "fma", target_arch = "aarch64")) {
        multiply(out, rows, panels, b, update, f32::mul_add);
    } else {
        multiply(out, rows, panels, b, update, |a, b, sum| a * b + sum);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;
    use crate::nn::product::product;
    use crate::testing::fill;

    fn matrix(rows: usize, columns: usize, stream: u32) -> DMatrix<f32> {
        let draws = fill(rows * columns, stream);
        DMatrix::from_iterator(rows, columns, draws.into_iter().map(|draw| draw as f32))
    }

    /// The contract by the letter: in order, one multiply-add after the other, then the update.
    fn by_the_letter(out: &mut DMatrix<f32>, a: &DMatrix<f32>, b: &DMatrix<f32>, update: Update<'_, f32>) {
        for row in 0..a.nrows() {
            for column in 0..b.ncols() {
                let sum = (0..a.ncols()).fold(0.0, |sum, k| a[(row, k)].mul_add(b[(k, column)], sum));
                out[(row, column)] = match update {
                    Update::Replace => sum,
                    Update::Add => out[(row, column)] + sum,
                    Update::Multiply => out[(row, column)] * sum,
                    Update::Plus(other) => other[column * a.nrows() + row] + sum,
                    Update::Times(other) => other[column * a.nrows() + row] * sum,
                };
            }
        }
    }

    fn bits(matrix: &DMatrix<f32>) -> Vec<u32> {
        matrix.iter().map(|value| value.to_bits()).collect()
    }

    /// Every width of a tile's columns, whole and partial panels, one and two of them, an empty inner dimension.
    #[test]
    fn every_kernel_has_the_bits_of_a_plain_loop() {
        for [m, n] in [[1, 1], [2, 5], [3, 31], [16, 12], [17, 23], [32, 27], [33, 13], [70, 6], [79, 12]] {
            for k in [0, 1, 2, 19, 132] {
                let (a, b, before, other) = (matrix(m, k, 1), matrix(k, n, 2), matrix(m, n, 3), matrix(m, n, 4));
                let other = other.as_slice();
                let (a_t, b_t) = (a.transpose(), b.transpose());
                let lefts = [Operand::from(&a), Operand::from(&a_t).transposed()];
                let rights = [Operand::from(&b), Operand::from(&b_t).transposed()];
                for update in
                    [Update::Replace, Update::Add, Update::Multiply, Update::Plus(other), Update::Times(other)]
                {
                    let mut expected = before.clone();
                    by_the_letter(&mut expected, &a, &b, update);
                    for (left, right) in lefts.into_iter().flat_map(|left| rights.map(|right| (left, right))) {
                        let packed = Packed::new(left);
                        for way in ["product", "packed", "safe"] {
                            let mut out = before.clone();
                            match way {
                                "product" => product(out.as_mut_slice(), left, right, update),
                                "packed" => packed.multiply(out.as_mut_slice(), right, update, &Ahead::new([other])),
                                _ => multiply_safely(out.as_mut_slice(), m, packed.panels(), right, update),
                            }
                            assert_eq!(bits(&out), bits(&expected), "{way}, {m} x {k} x {n}, {update:?}");
                        }
                    }
                }
            }
        }
    }
}
