//! Sums in single precision on the FPU, product and sum rounded apart.

use core::arch::naked_asm;

use crate::kernel::float;

/// Outputs whose sums are kept in registers.
const BLOCK: usize = 16;

/// [`Kernel::accumulate`](crate::Kernel).
pub(crate) fn accumulate(weights: &[f32], x: &[f32], out: &mut [f32]) {
    let stride = out.len();
    let (blocks, rest) = out.as_chunks_mut::<BLOCK>();
    let mut columns = weights;
    for block in blocks {
        // Inputs whose weights are there for the whole block.
        let rows = (columns.len() + stride).saturating_sub(BLOCK) / stride.max(1);
        let x = x.get(..rows).unwrap_or(x);
        // SAFETY: the last row of the block starts at `(x.len() - 1) * stride`
        // and lies within `columns`.
        unsafe { accumulate_block(columns.as_ptr(), x.as_ptr(), x.len(), block, (stride - BLOCK) * size_of::<f32>()) };
        columns = columns.get(BLOCK..).unwrap_or_default();
    }
    float::accumulate_rest(columns, stride, x, rest);
}

/// Adds an input to sixteen sums: its value in the register named, its weights at `r0`.
macro_rules! input {
    ($x:literal) => {
        concat!(
            "vldm r0!, {{s16-s23}}\n",
            input!($x, "s16", "s17", "s18", "s19", "s20", "s21", "s22", "s23"),
            "vadd.f32 s0, s0, s16\n vadd.f32 s1, s1, s17\n vadd.f32 s2, s2, s18\n vadd.f32 s3, s3, s19\n",
            "vadd.f32 s4, s4, s20\n vadd.f32 s5, s5, s21\n vadd.f32 s6, s6, s22\n vadd.f32 s7, s7, s23\n",
            "vldm r0!, {{s16-s23}}\n",
            input!($x, "s16", "s17", "s18", "s19", "s20", "s21", "s22", "s23"),
            "vadd.f32 s8, s8, s16\n vadd.f32 s9, s9, s17\n vadd.f32 s10, s10, s18\n vadd.f32 s11, s11, s19\n",
            "vadd.f32 s12, s12, s20\n vadd.f32 s13, s13, s21\n vadd.f32 s14, s14, s22\n vadd.f32 s15, s15, s23\n",
            "add r0, r0, r12\n",
        )
    };
    ($x:literal, $($weight:literal),+) => {
        concat!($("vmul.f32 ", $weight, ", ", $weight, ", ", $x, "\n"),+)
    };
}

/// Adds `inputs` products to each of sixteen sums, in their order; `skip` are
/// the bytes from the end of one input's weights to the next.
///
/// # Safety
/// `x` has `inputs` numbers, and `weights` sixteen for each of them.
#[unsafe(naked)]
unsafe extern "C" fn accumulate_block(
    weights: *const f32,
    x: *const f32,
    inputs: usize,
    sums: &mut [f32; BLOCK],
    skip: usize,
) {
    naked_asm!(
        processor!(),
        "ldr r12, [sp]",
        "vpush {{s16-s27}}",
        "vldm r3, {{s0-s15}}",
        "subs r2, r2, #4",
        "blo 3f",
        "2: vldm r1!, {{s24-s27}}",
        input!("s24"),
        input!("s25"),
        input!("s26"),
        input!("s27"),
        "subs r2, r2, #4",
        "bhs 2b",
        "3: adds r2, r2, #4",
        "beq 5f",
        "4: vldm r1!, {{s24}}",
        input!("s24"),
        "subs r2, r2, #1",
        "bne 4b",
        "5: vstm r3, {{s0-s15}}",
        "vpop {{s16-s27}}",
        "bx lr",
    )
}
