//! The board's memories, as the linker script parts them.

use core::ptr::addr_of;

/// What the stack is painted with before anything runs on it.
const PAINT: u32 = 0xCCCC_CCCC;

unsafe extern "C" {
    static _policy_start: u8;
    static _policy_end: u8;
    static _stack_start: u32;
    static _stack_end: u32;
}

/// The flash in which the policy lies, with what follows it.
pub(crate) fn policy_slot() -> &'static [u8] {
    // SAFETY: the linker script keeps this memory free, and nothing writes to it.
    unsafe {
        let start = addr_of!(_policy_start);
        core::slice::from_raw_parts(start, addr_of!(_policy_end).addr() - start.addr())
    }
}

/// Bytes of the stack that were ever in use: those above the lowest that lost its paint.
pub(crate) fn stack_high_water() -> u32 {
    let (lowest, highest) = (addr_of!(_stack_end), addr_of!(_stack_start));
    let mut place = lowest;
    // SAFETY: the words between both belong to the stack, and those that are in
    // use lie above this function's frame.
    while place < highest && unsafe { place.read_volatile() } == PAINT {
        place = place.wrapping_add(1);
    }
    (highest.addr() - place.addr()) as u32
}

/// Calls a function on another stack, which grows down from `top`.
///
/// # Safety
/// The memory below `top` is nobody else's meanwhile, and is enough.
pub(crate) unsafe fn call_on(top: *mut u8, function: extern "C" fn()) {
    // SAFETY: the caller's word; both procedure call standards want 16 bytes at most.
    unsafe { switch(top.map_addr(|address| address & !15), function) }
}

#[cfg(feature = "cortex-m")]
#[unsafe(naked)]
unsafe extern "C" fn switch(top: *mut u8, function: extern "C" fn()) {
    core::arch::naked_asm!("push {{r4, lr}}", "mov r4, sp", "mov sp, r0", "blx r1", "mov sp, r4", "pop {{r4, pc}}")
}

#[cfg(feature = "virt")]
#[unsafe(naked)]
unsafe extern "C" fn switch(top: *mut u8, function: extern "C" fn()) {
    core::arch::naked_asm!(
        "addi sp, sp, -16",
        "sw ra, 12(sp)",
        "sw s0, 8(sp)",
        "mv s0, sp",
        "mv sp, a0",
        "jalr a1",
        "mv sp, s0",
        "lw s0, 8(sp)",
        "lw ra, 12(sp)",
        "addi sp, sp, 16",
        "ret",
    )
}
