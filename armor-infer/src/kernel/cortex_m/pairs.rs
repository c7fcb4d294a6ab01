//! Sums over weights in pairs of rows ([`Layout::Paired`]).
//!
//! A half-word is `256 h + (l + 128)` for the weights `h` and `l` of two rows,
//! and a word holds those of two columns. SMLAD multiplies both half-words by
//! two codes and adds; UXTB16 leaves the `l + 128` of both.

use core::arch::naked_asm;

use armor_core::fixed::SHORT_BITS;
use armor_core::image::Layout;

use crate::kernel::integer;

/// Rows and columns of a block.
const BLOCK: usize = Layout::BLOCK;
/// Columns of the unrolled loops.
const UNROLLED: usize = 32;

/// [`Kernel::sum_rows`](crate::Kernel) of [`Layout::Paired`].
pub(crate) fn sum_pairs(weights: &[i8], codes: &[i16], bits: u32, sums: &mut [i32]) {
    // An image's weights and a controller's codes do.
    let on_words = weights.as_ptr().cast::<u32>().is_aligned() && codes.as_ptr().cast::<u32>().is_aligned();
    let group = Layout::Paired.bytes(BLOCK, codes.len());
    if !on_words || group == 0 {
        return integer::sum_pairs(weights, codes, sums);
    }
    let (whole, rest) = sums.as_chunks_mut::<BLOCK>();
    let there = whole.len().min(weights.len() / group);
    sum_groups(weights, codes, bits, whole.get_mut(..there).unwrap_or_default());
    let weights = weights.get(there * group..).unwrap_or_default();
    if weights.len() >= group {
        let mut last = [[0; BLOCK]];
        sum_groups(weights, codes, bits, &mut last);
        for (sum, total) in rest.iter_mut().zip(last.as_flattened()) {
            *sum = *total;
        }
    }
}

/// The sums of whole groups of four rows. `weights` holds them all, and lies on
/// words as `codes` does.
fn sum_groups(weights: &[i8], codes: &[i16], bits: u32, sums: &mut [[i32; BLOCK]]) {
    let (blocks, tail) = codes.as_chunks::<BLOCK>();
    let group = Layout::Paired.bytes(BLOCK, codes.len());
    if sums.is_empty() {
        return;
    }
    let columns = blocks.as_flattened().as_ptr_range();
    let plan = Plan {
        codes: columns.start,
        end: columns.end,
        unrolled_end: columns.start.wrapping_add(blocks.len() * BLOCK / UNROLLED * UNROLLED),
        sums_end: sums.as_ptr_range().end.cast(),
        skip: group - blocks.len() * BLOCK * BLOCK,
    };
    let sum = if bits == SHORT_BITS { sum_short } else { sum_long };
    // SAFETY: codes and weights lie on words; `weights` has a group for each
    // block of sums, and a group is the bytes of the columns and those skipped.
    unsafe { sum(weights.as_ptr(), &plan, sums.as_mut_ptr().cast()) };
    if !tail.is_empty() {
        // It is not 0 where there are columns; `max` tells the compiler, which else keeps a panic.
        for (sums, group) in sums.iter_mut().zip(weights.chunks_exact(group.max(1))) {
            if let Some(block) = group.last_chunk() {
                integer::add_block(block, tail, sums);
            }
        }
    }
}

/// What a sum runs over.
#[repr(C)]
struct Plan {
    /// The first code, on a word.
    codes: *const i16,
    /// The end of the codes; a multiple of four of them.
    end: *const i16,
    /// The end of as many of them as the unrolled loop takes.
    unrolled_end: *const i16,
    /// The end of the sums; a multiple of four of them.
    sums_end: *const i32,
    /// Bytes between the weights of one group of rows and the next.
    skip: usize,
}

/// The sum over all columns of `-128 x`, by which the low rows are off, into
/// `r10`; `r1` is the plan. Uses `r4` to `r8`.
macro_rules! offset {
    () => {
        "ldrd r6, r7, [r1]
         movs r4, #0
         mov r5, #0x00010001
         cmp r6, r7
         beq 3f
      2: ldr r8, [r6], #4
         smlad r4, r8, r5, r4
         ldr r8, [r6], #4
         smlad r4, r8, r5, r4
         cmp r6, r7
         bne 2b
      3: lsls r4, r4, #7
         rsbs r10, r4, #0"
    };
}

/// Starts a group: the first code in `r1`, from the plan at `[sp]`.
/// The end of a group: stores its sums and starts at the next, or returns.
macro_rules! next_group {
    () => {
        "ldr r2, [sp, #4]
         stm r2!, {{r10, r11, r12, lr}}
         ldr r3, [sp]
         str r2, [sp, #4]
         ldr r4, [r3, #16]
         ldr r3, [r3, #12]
         add r0, r0, r4
         cmp r2, r3
         bne 4b
         add sp, sp, #12
         pop {{r4-r11, pc}}"
    };
}

/// Adds four columns of four rows for codes of 7 bits: codes in the two
/// registers named, weights at `r0`. The high rows' sums are of whole
/// half-words, `256 h + l`.
macro_rules! short_block {
    ($first:literal, $second:literal) => {
        concat!(
            "ldm r0!, {{r6-r9}}\n",
            "smlad r11, r6, ",
            $first,
            ", r11\n",
            "smlad lr, r8, ",
            $first,
            ", lr\n",
            "uxtb16 r6, r6\n",
            "uxtb16 r8, r8\n",
            "smlad r10, r6, ",
            $first,
            ", r10\n",
            "smlad r12, r8, ",
            $first,
            ", r12\n",
            "smlad r11, r7, ",
            $second,
            ", r11\n",
            "smlad lr, r9, ",
            $second,
            ", lr\n",
            "uxtb16 r7, r7\n",
            "uxtb16 r9, r9\n",
            "smlad r10, r7, ",
            $second,
            ", r10\n",
            "smlad r12, r9, ",
            $second,
            ", r12\n",
        )
    };
}

/// Eight columns for codes of 7 bits.
macro_rules! short_blocks {
    () => {
        concat!("ldm r1!, {{r2-r5}}\n", short_block!("r2", "r3"), short_block!("r4", "r5"))
    };
}

/// Adds four columns of four rows for codes of 15 bits, each row by its own bytes.
macro_rules! long_block {
    () => {
        "ldrd r2, r3, [r1], #8
         ldm r0!, {{r6-r9}}
         uxtb16 r4, r6
         uxtb16 r5, r8
         sxtb16 r6, r6, ror #8
         sxtb16 r8, r8, ror #8
         smlad r10, r4, r2, r10
         smlad r12, r5, r2, r12
         smlad r11, r6, r2, r11
         smlad lr, r8, r2, lr
         uxtb16 r4, r7
         uxtb16 r5, r9
         sxtb16 r7, r7, ror #8
         sxtb16 r9, r9, ror #8
         smlad r10, r4, r3, r10
         smlad r12, r5, r3, r12
         smlad r11, r7, r3, r11
         smlad lr, r9, r3, lr\n"
    };
}

/// Sums over codes of 7 bits, 0.87 instructions a product in the unrolled loop.
///
/// `r0` weights, `r1` codes, `r2` to `r5` eight codes, `r6` to `r9` a block of
/// weights; `r10`, `r12` sums of the low rows and `r11`, `lr` of the high ones.
///
/// # Safety
/// All pointers lie on words. The plan's codes and sums are there, and
/// `weights` has four bytes for every code and the bytes to skip, for every
/// four sums. An odd number of words of codes is not allowed.
#[unsafe(naked)]
unsafe extern "C" fn sum_short(weights: *const i8, plan: &Plan, sums: *mut i32) {
    naked_asm!(
        processor!(),
        "push {{r4-r11, lr}}",
        "sub sp, sp, #12",
        "strd r1, r2, [sp]",
        offset!(),
        "str r10, [sp, #8]",
        "4: ldr r3, [sp]",
        "ldr r10, [sp, #8]",
        "ldr r1, [r3]",
        "ldr r2, [r3, #8]",
        "mov r11, r10",
        "mov r12, r10",
        "mov lr, r10",
        "cmp r1, r2",
        "beq 6f",
        "5:",
        short_blocks!(),
        short_blocks!(),
        short_blocks!(),
        short_blocks!(),
        "ldr r2, [sp]",
        "ldr r2, [r2, #8]",
        "cmp r1, r2",
        "bne 5b",
        "6: ldr r2, [sp]",
        "ldr r2, [r2, #4]",
        "cmp r1, r2",
        "beq 7f",
        "ldrd r2, r3, [r1], #8",
        short_block!("r2", "r3"),
        "b 6b",
        "7: sub r11, r11, r10",
        "sub lr, lr, r12",
        "asr r11, r11, #8",
        "asr lr, lr, #8",
        next_group!(),
    )
}

/// Sums over codes of 15 bits and a sign, 1.15 instructions a product in the unrolled loop.
///
/// Registers and safety as for [`sum_short`]; sums wrap on their way and are exact at their end.
#[unsafe(naked)]
unsafe extern "C" fn sum_long(weights: *const i8, plan: &Plan, sums: *mut i32) {
    naked_asm!(
        processor!(),
        "push {{r4-r11, lr}}",
        "sub sp, sp, #12",
        "strd r1, r2, [sp]",
        offset!(),
        "str r10, [sp, #8]",
        "4: ldr r3, [sp]",
        "ldr r10, [sp, #8]",
        "ldr r1, [r3]",
        "ldr r2, [r3, #8]",
        "mov r12, r10",
        "mov r11, #0",
        "mov lr, #0",
        "cmp r1, r2",
        "beq 6f",
        "5:",
        long_block!(),
        long_block!(),
        long_block!(),
        long_block!(),
        long_block!(),
        long_block!(),
        long_block!(),
        long_block!(),
        "ldr r2, [sp]",
        "ldr r2, [r2, #8]",
        "cmp r1, r2",
        "bne 5b",
        "6: ldr r2, [sp]",
        "ldr r2, [r2, #4]",
        "cmp r1, r2",
        "beq 7f",
        long_block!(),
        "b 6b",
        "7:",
        next_group!(),
    )
}
