/* Flies an episode of the ball with a policy image: fly IMAGE LIMIT SEED.
 *
 * Prints a line a step, numbers as the bits of their f32:
 *   state[7] incurred kappa rung action[2] */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "armor.h"
#include "ball_run.h"

/* As in firmware: all memory is there from the start. */
static _Alignas(ARMOR_CONTROLLER_ALIGN) uint8_t memory[ARMOR_CONTROLLER_SIZE];
static _Alignas(ARMOR_IMAGE_ALIGN) uint8_t image[4u << 20];

static int fail(const char *what, ArmorStatus status) {
    fprintf(stderr, "fly: %s: %s\n", what, armor_status_text(status));
    return 1;
}

static void print_bits(float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    printf("%08" PRIx32 " ", bits);
}

static int fly(size_t image_len, float limit, uint64_t seed) {
    ArmorInfo info;
    ArmorStatus status = armor_image_inspect(image, image_len, &info);
    if (status != ARMOR_STATUS_OK) {
        return fail("image", status);
    }
    if (info.state != BALL_RUN_STATE || info.action != BALL_RUN_ACTION) {
        fprintf(stderr, "fly: the policy is for %.*s, not for the ball\n", (int)info.task_len, info.task);
        return 1;
    }
    status = armor_golden_replay(memory, sizeof memory, image, image_len);
    if (status != ARMOR_STATUS_OK) {
        return fail("golden trace", status);
    }
    ArmorController *controller;
    status = armor_controller_init(memory, sizeof memory, image, image_len, limit, seed, &controller);
    if (status != ARMOR_STATUS_OK) {
        return fail("controller", status);
    }

    BallRun ball;
    ball_run_reset(&ball);
    float incurred = 0.0f, cost = 0.0f, reward = 0.0f;
    for (int i = 0; i < BALL_RUN_STEPS; ++i) {
        float state[BALL_RUN_STATE];
        ArmorStep step;
        ball_run_sense(&ball, state);
        status = armor_step(controller, state, BALL_RUN_STATE, incurred, &step);
        if (status != ARMOR_STATUS_OK) {
            fail("step", status); /* step holds the fallback action: the robot does that */
        }
        for (int entry = 0; entry < BALL_RUN_STATE; ++entry) {
            print_bits(state[entry]);
        }
        print_bits(incurred);
        print_bits(step.kappa);
        printf("%" PRId32 " ", step.rung);
        print_bits(step.action[0]);
        print_bits(step.action[1]);
        putchar('\n');
        incurred = ball_run_step(&ball, step.action, &reward);
        cost += incurred;
    }
    fprintf(stderr, "fly: reward %.1f, cost %.0f of %.0f\n", reward, cost, limit);
    return 0;
}

int main(int argc, char **argv) {
    if (argc != 4) {
        fprintf(stderr, "usage: fly IMAGE LIMIT SEED\n");
        return 2;
    }
    FILE *file = fopen(argv[1], "rb");
    if (file == NULL) {
        perror(argv[1]);
        return 1;
    }
    const size_t image_len = fread(image, 1, sizeof image, file);
    fclose(file);
    return fly(image_len, strtof(argv[2], NULL), strtoull(argv[3], NULL, 10));
}
