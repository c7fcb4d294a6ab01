//! Sums over rows of weights for codes of 7 bits, sixteen products at a time
//! (MVE of a Cortex-M55).

use core::arch::naked_asm;

use crate::kernel::integer;

/// Products of an instruction.
const LANES: usize = 16;
/// Rows whose sums are taken side by side.
const ROWS: usize = 4;

/// [`Kernel::sum_rows`](crate::Kernel) of [`Layout::Rows`](armor_core::image::Layout) for codes of 7 bits.
pub(crate) fn sum_rows_short(weights: &[i8], codes: &[i16], sums: &mut [i32]) {
    let (stride, chunks) = (codes.len(), codes.len() / LANES);
    if chunks == 0 {
        return integer::sum_rows(weights, codes, sums);
    }
    let (blocks, rest) = sums.as_chunks_mut::<ROWS>();
    let (_, tail) = codes.as_chunks::<LANES>();
    let groups = weights.chunks_exact((ROWS * stride).max(ROWS));
    for (block, group) in blocks.iter_mut().zip(groups) {
        // SAFETY: `group` is four rows of `stride` weights and `codes` as long
        // as one; `chunks` are those of a row, and there is one.
        unsafe { sum_four(group.as_ptr(), codes.as_ptr(), block, stride, chunks) };
        for (sum, row) in block.iter_mut().zip(group.chunks_exact(stride.max(1))) {
            let rest = row.get(chunks * LANES..).unwrap_or_default().iter().zip(tail);
            *sum += rest.map(|(weight, code)| i32::from(*weight) * i32::from(*code)).sum::<i32>();
        }
    }
    integer::sum_rows(weights.get(blocks.len() * ROWS * stride..).unwrap_or_default(), codes, rest);
}

/// Sums over `chunks` of sixteen codes of four rows, which lie `stride` bytes apart.
/// VLD20 and VLD21 part the low bytes of codes, which are all of 7 bits, from the high ones.
///
/// # Safety
/// There are as many weights in each row and as many codes, and at least one chunk.
#[unsafe(naked)]
unsafe extern "C" fn sum_four(
    weights: *const i8,
    codes: *const i16,
    sums: &mut [i32; ROWS],
    stride: usize,
    chunks: usize,
) {
    naked_asm!(
        processor!(),
        "push {{r4-r10, lr}}",
        "ldr r12, [sp, #32]",
        "add r5, r0, r3",
        "add r7, r5, r3",
        "add r9, r7, r3",
        "movs r4, #0",
        "movs r6, #0",
        "mov r8, #0",
        "mov r10, #0",
        "dls lr, r12",
        "2: vld20.8 {{q0, q1}}, [r1]",
        "vld21.8 {{q0, q1}}, [r1]!",
        "vldrb.u8 q2, [r0], #16",
        "vmladava.s8 r4, q0, q2",
        "vldrb.u8 q3, [r5], #16",
        "vmladava.s8 r6, q0, q3",
        "vldrb.u8 q2, [r7], #16",
        "vmladava.s8 r8, q0, q2",
        "vldrb.u8 q3, [r9], #16",
        "vmladava.s8 r10, q0, q3",
        "le lr, 2b",
        "stm r2, {{r4, r6, r8, r10}}",
        "pop {{r4-r10, pc}}",
    )
}
