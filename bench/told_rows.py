"""Keeps of a recording what its sensors tell the whole state of, for `armor-train data calibrate`.

    python told_rows.py ball-circle|point-goal IN.hdf5 OUT.hdf5

ball-circle: episodes that stay 11 m within the octagon, whose walls the plant
leaves out. point-goal: steps on which the goal is in range of the lidar before
and after, none is reached, and the vase is too far to be touched; each becomes
an episode of its own.
"""

import sys

import h5py
import numpy as np

INSIDE = 11.0
"""Distance of the ball from the centre in m; the walls stand at 12.4 m."""
VASE_CLOSENESS = 0.88
"""Lidar reading of a vase at 0.36 m, beyond the reach of robot and vase."""


def ball_circle(data: dict[str, np.ndarray]) -> np.ndarray:
    """Rows of the episodes that meet no wall."""
    ends = np.flatnonzero(data["timeouts"]) + 1
    distance = 10 * np.hypot(*data["next_observations"][:, :2].T)
    inside = np.zeros(len(distance), bool)
    for start, end in zip(np.r_[0, ends[:-1]], ends, strict=True):
        inside[start:end] = distance[start:end].max() < INSIDE
    return inside


def point_goal(data: dict[str, np.ndarray]) -> np.ndarray:
    """Rows that the sensors determine."""
    goal, vase = slice(12, 28), slice(44, 60)
    both = [data[name] for name in ("observations", "next_observations")]
    seen = np.all([rows[:, goal].max(axis=1) > 0 for rows in both], axis=0)
    far = np.all([rows[:, vase].max(axis=1) < VASE_CLOSENESS for rows in both], axis=0)
    kept = seen & far & (data["rewards"] < 0.5)
    data["timeouts"][kept] = True
    return kept


def main() -> None:
    """Filter the files of the command line."""
    task, source, target = sys.argv[1:]
    with h5py.File(source) as file:
        data = {name: file[name][:] for name in file}
    kept = {"ball-circle": ball_circle, "point-goal": point_goal}[task](data)
    with h5py.File(target, "w") as file:
        for name, column in data.items():
            file.create_dataset(name, data=column[kept], compression="gzip")
    print(f"{kept.sum()} of {len(kept)} rows kept")


if __name__ == "__main__":
    main()
