/* Firmware in C, as it is there before ARMOR comes to it: it has a vector
 * table, start-up and C library of its own, and links libarmor.a for the rest.
 *
 * It flies an episode of the example's ball with the policy in flash, prints it
 * as armor-infer/examples/c/fly.c does, a line a step, and then the stack's
 * high-water mark. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "armor.h"
#include "ball_run.h"
#include "board.h"

static const float LIMIT = 5.0f;
static const uint64_t SEED = 11;

/* All memory is there from the start. */
static _Alignas(ARMOR_CONTROLLER_ALIGN) uint8_t memory[ARMOR_CONTROLLER_SIZE];

/* A number's bits and a space, at the front of `text`; returns what follows. */
static char *bits(char *text, float value) {
    uint32_t word;
    memcpy(&word, &value, sizeof word);
    return text + sprintf(text, "%08" PRIx32 " ", word);
}

static ArmorStatus fly(void) {
    const uint8_t *image = board_policy();
    const size_t length = board_policy_bytes();
    ArmorStatus status = armor_golden_replay(memory, sizeof memory, image, length);
    if (status != ARMOR_STATUS_OK) {
        return status;
    }
    ArmorController *controller;
    status = armor_controller_init(memory, sizeof memory, image, length, LIMIT, SEED, &controller);
    if (status != ARMOR_STATUS_OK) {
        return status;
    }
    BallRun ball;
    ball_run_reset(&ball);
    float incurred = 0.0f, reward = 0.0f;
    for (int i = 0; i < BALL_RUN_STEPS; ++i) {
        float state[BALL_RUN_STATE];
        ArmorStep step;
        ball_run_sense(&ball, state);
        status = armor_step(controller, state, BALL_RUN_STATE, incurred, &step);
        if (status != ARMOR_STATUS_OK) {
            return status;
        }
        static char line[128];
        char *end = line;
        for (int entry = 0; entry < BALL_RUN_STATE; ++entry) {
            end = bits(end, state[entry]);
        }
        end = bits(bits(end, incurred), step.kappa);
        end += sprintf(end, "%" PRId32 " ", step.rung);
        end = bits(bits(end, step.action[0]), step.action[1]);
        strcpy(end, "\n");
        board_print(line);
        incurred = ball_run_step(&ball, step.action, &reward);
    }
    return ARMOR_STATUS_OK;
}

int main(void) {
    const ArmorStatus status = fly();
    if (status != ARMOR_STATUS_OK) {
        board_print("failed ");
        board_print(armor_status_text(status));
        board_print("\n");
        return 1;
    }
    char line[32];
    sprintf(line, "stack_bytes %" PRIu32 "\n", board_stack_bytes());
    board_print(line);
    return 0;
}
