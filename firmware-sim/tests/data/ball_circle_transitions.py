"""Twenty control steps of SafetyBallCircle-v0 (bullet-safety-gym 1.4.0, PyBullet 3.2.7).

A row is observation [8], action [2], reward, cost, next observation [8], in
single precision, made by

    python firmware-sim/tests/data/ball_circle_transitions.py | grep , > firmware-sim/tests/data/ball_circle_transitions.csv
"""

import bullet_safety_gym  # noqa: F401
import gymnasium
import numpy as np

ROWS = 20

np.random.seed(4)
env = gymnasium.make("SafetyBallCircle-v0")
before, _ = env.reset()
for row in range(ROWS):
    # Outwards first, so that the line is crossed; then anywhere.
    action = np.array([1.0, 0.2]) if row < 12 else np.random.uniform(-1.2, 1.2, 2)
    after, reward, _, _, info = env.step(action)
    values = [*before, *action, reward, info["cost"], *after]
    print(",".join(str(np.float32(value)) for value in values))
    before = after
