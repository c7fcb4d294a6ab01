"""What SafetyPointGoal1-v0 observes at the start of episodes, and where everything is.

A row is place (2) and heading of the robot, goal (2), hazards (8 x 2), vase (2),
the observation [60], and what a step of full thrust then pays. Made with
safety-gymnasium 1.0.0 and the package of `firmware-sim/python`, which mends it, by

    python firmware-sim/tests/data/point_goal_layouts.py 2>/dev/null | grep -v Adroit > firmware-sim/tests/data/point_goal_layouts.csv
"""

import math

from armor_plant import repairs

with repairs.array_defaults():
    import safety_gymnasium

ROWS = 8

env = safety_gymnasium.make("SafetyPointGoal1-v0")
for seed in range(ROWS):
    observation, _ = env.reset(seed=seed)
    task = env.unwrapped.task
    turn = task.agent.mat
    robot, *others = [place[:2] for place in [task.agent.pos, task.goal.pos, *task.hazards.pos, *task.vases.pos]]
    heading = math.atan2(turn[1, 0], turn[0, 0])
    row = [*robot, heading, *(x for place in others for x in place), *observation]
    _, reward, *_ = env.step([1.0, 0.0])
    print(",".join(repr(float(value)) for value in [*row, reward]))
