/* A ball that rolls over a plane and is to run along x: fast, but not above a
 * speed and not off the track, which costs 1 a step. A plant for the example;
 * firmware-sim/src/plant has one that reproduces its simulator. */
#ifndef BALL_RUN_H
#define BALL_RUN_H

enum { BALL_RUN_STATE = 7, BALL_RUN_ACTION = 2, BALL_RUN_STEPS = 100 };

typedef struct {
    float position[2]; /* m */
    float velocity[2]; /* m/s */
} BallRun;

/* The ball drifts towards the edge of the track. */
void ball_run_reset(BallRun *ball);

/* What the sensors say. */
void ball_run_sense(const BallRun *ball, float state[BALL_RUN_STATE]);

/* Does an action for 1/30 s; adds the step's reward, returns its cost. */
float ball_run_step(BallRun *ball, const float action[BALL_RUN_ACTION], float *reward);

#endif
