//! From sums to pre-activations to codes.
//!
//! SMMULR is [`armor_core::fixed::mul_round`], and SMMLAR adds a bias to it.

use core::arch::naked_asm;

use armor_core::fixed::{
    LONG_BITS, LOWEST_ACTIVATION, MISH_RESIDUAL, PRE_MAX, SHORT_BITS, TABLE_END, TABLE_START, TABLE_STEP_BITS,
    WIDEN_BITS,
};

use crate::kernel::integer;

/// Sums or pre-activations that are worked on at a time.
const BLOCK: usize = 4;

/// [`Kernel::rescale`](crate::Kernel).
pub(crate) fn rescale(sums: &mut [i32], bits: u32, multiplier: &[i32], factor: i32, bias: &[i32]) {
    let whole = sums.len().min(multiplier.len()).min(bias.len()) / BLOCK * BLOCK;
    let scale = if bits == SHORT_BITS { rescale_short } else { rescale_long };
    if whole > 0 {
        // SAFETY: all three slices hold `whole` numbers, a multiple of four.
        unsafe { scale(sums.as_mut_ptr(), multiplier.as_ptr(), bias.as_ptr(), factor, whole) };
    }
    let [multiplier, bias] = [multiplier, bias].map(|rest| rest.get(whole..).unwrap_or_default());
    integer::rescale(sums.get_mut(whole..).unwrap_or_default(), bits, multiplier, factor, bias);
}

/// [`Kernel::activate`](crate::Kernel).
pub(crate) fn activate(pre: &[i32], factor: i32, bits: u32, codes: &mut [i16]) {
    let whole = if codes.as_ptr().cast::<u32>().is_aligned() { pre.len().min(codes.len()) / BLOCK * BLOCK } else { 0 };
    let code = if bits == SHORT_BITS { activate_short } else { activate_long };
    if let (1.., Some(zero)) = (whole, MISH_RESIDUAL.get((-TABLE_START >> TABLE_STEP_BITS) as usize..)) {
        // SAFETY: both slices hold `whole` numbers, a multiple of four, and the
        // codes lie on words; the table spans the saturated pre-activations.
        unsafe { code(pre.as_ptr(), codes.as_mut_ptr(), whole, factor, zero.as_ptr()) };
    }
    let codes = codes.get_mut(whole..).unwrap_or_default();
    integer::activate(pre.get(whole..).unwrap_or_default(), factor, bits, codes);
}

macro_rules! rescale {
    ($align:literal) => {
        naked_asm!(
            processor!(),
            "push {{r4-r11, lr}}",
            "ldr r12, [sp, #36]",
            "2: ldm r0, {{r4-r7}}",
            "ldm r1!, {{r8-r11}}",
            $align,
            "smmulr r4, r4, r8",
            "smmulr r5, r5, r9",
            "smmulr r6, r6, r10",
            "smmulr r7, r7, r11",
            "ldm r2!, {{r8-r11}}",
            "smmlar r4, r4, r3, r8",
            "smmlar r5, r5, r3, r9",
            "smmlar r6, r6, r3, r10",
            "smmlar r7, r7, r3, r11",
            "stm r0!, {{r4-r7}}",
            "subs r12, r12, #4",
            "bne 2b",
            "pop {{r4-r11, pc}}",
        )
    };
}

/// Rescales `count` sums over codes of 7 bits.
///
/// # Safety
/// The pointers lie on words; `count` is a multiple of four, not 0, and at most
/// the length of all three.
#[unsafe(naked)]
unsafe extern "C" fn rescale_short(
    sums: *mut i32,
    multiplier: *const i32,
    bias: *const i32,
    factor: i32,
    count: usize,
) {
    rescale!("lsls r4, r4, #8\n lsls r5, r5, #8\n lsls r6, r6, #8\n lsls r7, r7, #8")
}

/// Rescales `count` sums over codes of 15 bits.
///
/// # Safety
/// As for [`rescale_short`].
#[unsafe(naked)]
unsafe extern "C" fn rescale_long(sums: *mut i32, multiplier: *const i32, bias: *const i32, factor: i32, count: usize) {
    rescale!("")
}

// What the instructions below say in numbers.
const _: () = {
    assert!(TABLE_START == -(1 << 16) && TABLE_END == 1 << 16 && TABLE_STEP_BITS == 7 && WIDEN_BITS == 11);
    assert!(PRE_MAX == (1 << 19) - 1 && LOWEST_ACTIVATION == -0x0028_0000);
    assert!(SHORT_BITS == 7 && LONG_BITS == 15);
};

/// The code of a pre-activation, in place: [`armor_core::fixed::activate`]. One
/// load brings both entries of the table, from where it says 0 in `r4`; the two
/// weights `128 - f` and `f` are `65535 f + 128`.
macro_rules! code {
    ($bits:literal, $z:literal, $t:literal, $entries:literal) => {
        concat!(
            "ssat ",
            $t,
            ", #17, ",
            $z,
            "\n",
            "asr ",
            $entries,
            ", ",
            $t,
            ", #7\n",
            "ldr ",
            $entries,
            ", [r4, ",
            $entries,
            ", lsl #1]\n",
            "and ",
            $t,
            ", ",
            $t,
            ", #127\n",
            "mla ",
            $t,
            ", ",
            $t,
            ", r5, r6\n",
            "usat ",
            $z,
            ", #19, ",
            $z,
            "\n",
            "smlad ",
            $t,
            ", ",
            $entries,
            ", ",
            $t,
            ", r7\n",
            "add ",
            $z,
            ", ",
            $t,
            ", ",
            $z,
            ", lsl #11\n",
            "smmulr ",
            $z,
            ", ",
            $z,
            ", r3\n",
            "usat ",
            $z,
            ", #",
            $bits,
            ", ",
            $z,
            "\n",
        )
    };
}

macro_rules! activate {
    ($bits:literal) => {
        naked_asm!(
            processor!(),
            "push {{r4-r11, lr}}",
            "ldr r4, [sp, #36]",
            "movw r5, #65535",
            "mov r6, #128",
            "mov r7, #0x280000",
            "2: ldrd r8, r9, [r0], #8",
            code!($bits, "r8", "r10", "r11"),
            code!($bits, "r9", "r12", "lr"),
            "pkhbt r8, r8, r9, lsl #16",
            "ldrd r9, r10, [r0], #8",
            "str r8, [r1], #4",
            code!($bits, "r9", "r11", "r12"),
            code!($bits, "r10", "lr", "r8"),
            "pkhbt r9, r9, r10, lsl #16",
            "subs r2, r2, #4",
            "str r9, [r1], #4",
            "bne 2b",
            "pop {{r4-r11, pc}}",
        )
    };
}

/// Activates `count` units to codes of 7 bits; `zero` is the table's entry of pre-activation 0.
///
/// # Safety
/// The pointers but `zero` lie on words; `count` is a multiple of four, not 0,
/// and at most the length of both. Half-words need not lie on words for `ldr`.
#[unsafe(naked)]
unsafe extern "C" fn activate_short(pre: *const i32, codes: *mut i16, count: usize, factor: i32, zero: *const i16) {
    activate!("7")
}

/// Activates `count` units to codes of 15 bits.
///
/// # Safety
/// As for [`activate_short`].
#[unsafe(naked)]
unsafe extern "C" fn activate_long(pre: *const i32, codes: *mut i16, count: usize, factor: i32, zero: *const i16) {
    activate!("15")
}
