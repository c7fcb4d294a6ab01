#include "board.h"

#include <string.h>

int main(void);

/* Of the linker script. */
extern uint32_t __sidata[], __sdata[], __edata[], __sbss[], __ebss[], _stack_end[], _stack_start[];
extern const uint8_t _policy_start[], _policy_end[];

static const uint32_t PAINT = 0xCCCCCCCC;

/* Arm's semihosting: what the debugger does for a program. */
enum { SYS_WRITE0 = 0x04, SYS_EXIT_EXTENDED = 0x20, APPLICATION_EXIT = 0x20026 };

static void semihosting(int operation, const void *argument) {
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}

static _Noreturn void leave(uint32_t code) {
    const uint32_t block[] = {APPLICATION_EXIT, code};
    semihosting(SYS_EXIT_EXTENDED, block);
    for (;;) {
    }
}

static _Noreturn void fault(void) {
    board_print("failed processor-fault\n");
    leave(1);
}

static _Noreturn void reset(void) {
    /* Coprocessor access control (Armv7-M ARM, B3.2.20): the floating-point unit is on. */
    volatile uint32_t *const cpacr = (volatile uint32_t *)0xE000ED88;
    *cpacr |= 0xFu << 20;
    __asm__ volatile("dsb\n isb");
    uint32_t *here;
    __asm__ volatile("mov %0, sp" : "=r"(here));
    for (volatile uint32_t *word = _stack_end; word < here; ++word) {
        *word = PAINT;
    }
    memcpy(__sdata, __sidata, (size_t)((uint8_t *)__edata - (uint8_t *)__sdata));
    memset(__sbss, 0, (size_t)((uint8_t *)__ebss - (uint8_t *)__sbss));
    leave((uint32_t)main());
}

/* The initial stack pointer, reset, then the exceptions up to SysTick. */
__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    void (*exceptions[15])(void);
} VECTORS = {_stack_start, {reset, fault, fault, fault, fault, fault}};

const uint8_t *board_policy(void) {
    return _policy_start;
}

size_t board_policy_bytes(void) {
    return (size_t)(_policy_end - _policy_start);
}

uint32_t board_stack_bytes(void) {
    const volatile uint32_t *word = _stack_end;
    while (word < _stack_start && *word == PAINT) {
        ++word;
    }
    return (uint32_t)((const uint8_t *)_stack_start - (const uint8_t *)word);
}

void board_print(const char *text) {
    semihosting(SYS_WRITE0, text);
}

/* newlib asks for these where it could need a heap or a file; here it never does. */
void *_sbrk(ptrdiff_t increment) {
    (void)increment;
    return (void *)-1;
}
