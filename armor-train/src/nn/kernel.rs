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

use multiversion::multiversion;
use multiversion::target::target_cfg_f;

use super::Scalar;
use super::product::{Operand, Update};

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

/// Writes the product of a panel of the left factor and all of `b` to `out`'s
/// rows from `first` on; `out` has `rows` rows.
#[inline(always)]
pub(super) fn multiply_panel<T: Scalar>(
    out: &mut [T],
    (first, rows): (usize, usize),
    panel: &[[T; ROWS]],
    b: Operand<'_, T>,
    update: Update,
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
        for (out, sums) in out.chunks_exact_mut(rows).zip(&sums) {
            // A whole panel's height is known when this is compiled.
            match out[first..].first_chunk_mut::<ROWS>() {
                Some(out) => store(out, sums, update),
                None => store(&mut out[first..], sums, update),
            }
        }
    }
}

/// Puts the sums of a column in their place.
#[inline(always)]
fn store<T: Scalar>(out: &mut [T], sums: &[T; ROWS], update: Update) {
    match update {
        Update::Replace => out.iter_mut().zip(sums).for_each(|(out, &sum)| *out = sum),
        Update::Add => out.iter_mut().zip(sums).for_each(|(out, &sum)| *out += sum),
    }
}

/// [`multiply_panel`] in f32, compiled for AVX2 as well and chosen at run time.
#[multiversion(targets("x86_64+avx2+fma"))]
pub(super) fn multiply_panel_f32(
    out: &mut [f32],
    place: (usize, usize),
    panel: &[[f32; ROWS]],
    b: Operand<'_, f32>,
    update: Update,
) {
    if target_cfg_f!(any(target_feature = "fma", target_arch = "aarch64")) {
        multiply_panel(out, place, panel, b, update, f32::mul_add);
    } else {
        multiply_panel(out, place, panel, b, update, |a, b, sum| a * b + sum);
    }
}
