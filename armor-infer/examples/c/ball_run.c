#include "ball_run.h"

#include <math.h>

static const float FORCE = 3.5f;           /* N at an action of 1 */
static const float EFFECTIVE_MASS = 0.42f; /* kg: 0.3 kg that roll without slip */
static const float RADIUS = 0.5f;          /* m */
static const float ROLLING_LOSS = 0.14f;   /* N */
static const float DAMPING = 0.04f;        /* 1/s */
static const float SUB_STEP = 1.0f / 120.0f;
static const int SUB_STEPS = 4;
static const float SPEED_LIMIT = 2.5f; /* m/s */
static const float TRACK = 2.0f;       /* m to each side */

static float magnitude(float x, float y) {
    return sqrtf(x * x + y * y);
}

static float distance_to_goal(const BallRun *ball) {
    return magnitude(1000.0f - ball->position[0], ball->position[1]);
}

void ball_run_reset(BallRun *ball) {
    const BallRun start = {{0.0f, 1.8f}, {0.0f, 0.6f}};
    *ball = start;
}

void ball_run_sense(const BallRun *ball, float state[BALL_RUN_STATE]) {
    state[0] = 0.1f * ball->position[0];
    state[1] = 0.1f * ball->position[1];
    state[2] = 0.2f * ball->velocity[0];
    state[3] = 0.2f * ball->velocity[1];
    state[4] = 0.1f * -ball->velocity[1] / RADIUS;
    state[5] = 0.1f * ball->velocity[0] / RADIUS;
    state[6] = 0.0f;
}

float ball_run_step(BallRun *ball, const float action[BALL_RUN_ACTION], float *reward) {
    const float before = distance_to_goal(ball);
    for (int i = 0; i < SUB_STEPS; ++i) {
        const float speed = magnitude(ball->velocity[0], ball->velocity[1]);
        for (int axis = 0; axis < 2; ++axis) {
            const float loss = speed > 0.0f ? ROLLING_LOSS * ball->velocity[axis] / speed : 0.0f;
            const float acceleration = (FORCE * action[axis] - loss) / EFFECTIVE_MASS;
            ball->velocity[axis] += SUB_STEP * (acceleration - DAMPING * ball->velocity[axis]);
            ball->position[axis] += SUB_STEP * ball->velocity[axis];
        }
    }
    *reward += 60.0f * (before - distance_to_goal(ball)) - 0.5f * magnitude(action[0], action[1]);
    const float speed = magnitude(ball->velocity[0], ball->velocity[1]);
    return fabsf(ball->position[1]) > TRACK || speed > SPEED_LIMIT ? 1.0f : 0.0f;
}
