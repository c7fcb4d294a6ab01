//! From reset to [`crate::main`], and what happens where the processor finds a fault.

use semihosting::process::exit;

use crate::FAILURE;
use crate::console::tell_words;

#[cfg(feature = "cortex-m")]
mod cortex_m {
    use cortex_m_rt::{ExceptionFrame, entry, exception};

    #[entry]
    fn start() -> ! {
        crate::main()
    }

    #[exception]
    unsafe fn HardFault(_: &ExceptionFrame) -> ! {
        super::fault()
    }
}

/// What cortex-m-rt does on the others.
#[cfg(feature = "virt")]
mod riscv {
    core::arch::global_asm!(
        ".section .init, \"ax\"",
        ".global _start",
        "_start:",
        ".option push",
        ".option norelax",
        "la gp, __global_pointer$",
        ".option pop",
        "la sp, _stack_start",
        "la t0, {fault}",
        "csrw mtvec, t0",
        "la t0, _stack_end",
        "li t1, 0xCCCCCCCC",
        "0: sw t1, 0(t0)",
        "addi t0, t0, 4",
        "bltu t0, sp, 0b",
        "la t0, __sbss",
        "la t1, __ebss",
        "0: bgeu t0, t1, 1f",
        "sw zero, 0(t0)",
        "addi t0, t0, 4",
        "j 0b",
        "1: la t0, __sdata",
        "la t1, __edata",
        "la t2, __sidata",
        "0: bgeu t0, t1, 1f",
        "lw t3, 0(t2)",
        "sw t3, 0(t0)",
        "addi t0, t0, 4",
        "addi t2, t2, 4",
        "j 0b",
        // mstatus.FS = initial: the floating-point unit is on, where there is one.
        "1: li t0, 0x2000",
        "csrs mstatus, t0",
        "call {start}",
        fault = sym fault,
        start = sym start,
    );

    extern "C" fn start() -> ! {
        crate::main()
    }

    /// mtvec wants a multiple of 4.
    #[unsafe(naked)]
    extern "C" fn fault() -> ! {
        core::arch::naked_asm!(".balign 4", "tail {fault}", fault = sym super::fault)
    }
}

extern "C" fn fault() -> ! {
    tell_words(c"failed processor-fault");
    exit(FAILURE)
}

/// Never linked in: nothing panics, and `tests/mcu.sh` looks whether this is there.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    exit(FAILURE)
}
