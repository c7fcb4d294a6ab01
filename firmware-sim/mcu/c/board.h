/* What the C firmware needs of the board AN386, a Cortex-M4F under QEMU. */
#ifndef BOARD_H
#define BOARD_H

#include <stddef.h>
#include <stdint.h>

/* The flash in which the policy lies, with what follows it. */
const uint8_t *board_policy(void);
size_t board_policy_bytes(void);

/* Bytes of the stack that were ever in use. */
uint32_t board_stack_bytes(void);

/* Prints text on the debugger's console. */
void board_print(const char *text);

#endif
