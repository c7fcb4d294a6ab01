"""Control steps of Safety-Gymnasium's Point robot, in MuJoCo, from random states.

A row is place (2), heading, velocity (2), spin, action (2); then the same six
after one control step, and the twelve sensors. Made with mujoco 2.3.3 and
safety-gymnasium 1.0.0 by

    python firmware-sim/tests/data/point_steps.py > firmware-sim/tests/data/point_steps.csv
"""

from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np

ROWS = 40
SUBSTEPS = 10

package = Path(find_spec("safety_gymnasium").origin).parent
model = mujoco.MjModel.from_xml_path(str(package / "assets/xmls/point.xml"))
data = mujoco.MjData(model)
random = np.random.default_rng(0)

for row in range(ROWS):
    place = random.uniform(-1.5, 1.5, 2)
    heading = random.uniform(-np.pi, np.pi)
    speed, drift = random.uniform(-1, 1.5), random.uniform(-0.2, 0.2)
    velocity = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]]) @ [speed, drift]
    action = random.uniform(-1, 1, 2)
    # Every third thrust is small enough not to saturate; every fourth robot spins freely.
    action[0] *= 0.05 if row % 3 == 0 else 1
    spin = random.uniform(-6, 6) if row % 4 == 0 else 3 * action[1] + random.normal(0, 0.5)
    data.qpos[:] = [*place, heading]
    data.qvel[:] = [*velocity, spin]
    before = [*data.qpos, *data.qvel]
    data.ctrl[:] = action
    for _ in range(SUBSTEPS):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    values = [*before, *action, *data.qpos, *data.qvel, *data.sensordata[:12]]
    print(",".join(repr(float(value)) for value in values))
