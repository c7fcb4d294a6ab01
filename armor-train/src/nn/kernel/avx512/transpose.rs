//! The transpose of a block of 16 x 16 numbers, in registers.

use core::arch::x86_64::*;

use crate::nn::kernel::ROWS;

/// Exchanges rows and columns.
///
/// A register has four lanes of four numbers. Numbers are put in order within the lanes of four
/// neighbouring rows, then whole lanes across all rows.
#[target_feature(enable = "avx512f")]
pub(super) fn transpose(block: &mut [[f32; ROWS]; ROWS]) {
    // SAFETY: a row has the 16 numbers of a register.
    let rows = block.each_ref().map(|row| unsafe { _mm512_loadu_ps(row.as_ptr()) });
    let mut fours = rows;
    for (four, row) in fours.chunks_exact_mut(4).zip(rows.chunks_exact(4)) {
        // Numbers 0 and 1 of the lanes, then 2 and 3: of rows 0 and 1, then of 2 and 3.
        let pairs = [(row[0], row[1]), (row[2], row[3])];
        let [low, low_below] = pairs.map(|(a, b)| _mm512_castps_pd(_mm512_unpacklo_ps(a, b)));
        let [high, high_below] = pairs.map(|(a, b)| _mm512_castps_pd(_mm512_unpackhi_ps(a, b)));
        four[0] = _mm512_castpd_ps(_mm512_unpacklo_pd(low, low_below));
        four[1] = _mm512_castpd_ps(_mm512_unpackhi_pd(low, low_below));
        four[2] = _mm512_castpd_ps(_mm512_unpacklo_pd(high, high_below));
        four[3] = _mm512_castpd_ps(_mm512_unpackhi_pd(high, high_below));
    }
    // Now lane `l` of `fours[4 r + c]` has column `4 l + c` of rows `4 r` to `4 r + 3`.
    const EVEN: i32 = 0b10_00_10_00;
    const ODD: i32 = 0b11_01_11_01;
    for column in 0..4 {
        let [one, two, three, four] = [0, 4, 8, 12].map(|row| fours[row + column]);
        let even = [_mm512_shuffle_f32x4::<EVEN>(one, two), _mm512_shuffle_f32x4::<EVEN>(three, four)];
        let odd = [_mm512_shuffle_f32x4::<ODD>(one, two), _mm512_shuffle_f32x4::<ODD>(three, four)];
        let columns = [
            _mm512_shuffle_f32x4::<EVEN>(even[0], even[1]),
            _mm512_shuffle_f32x4::<EVEN>(odd[0], odd[1]),
            _mm512_shuffle_f32x4::<ODD>(even[0], even[1]),
            _mm512_shuffle_f32x4::<ODD>(odd[0], odd[1]),
        ];
        for (lane, numbers) in columns.into_iter().enumerate() {
            // SAFETY: as above.
            unsafe { _mm512_storeu_ps(block[4 * lane + column].as_mut_ptr(), numbers) };
        }
    }
}
