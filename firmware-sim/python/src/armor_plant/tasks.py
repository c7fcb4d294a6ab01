"""The 14 tasks of the paper, and SafetyBallCircle-v0: sizes, horizons, constants of scores.

``tasks.json`` is written from the project's table (``firmware-sim/src/task.rs``).
"""

import json
from dataclasses import dataclass
from importlib import resources


@dataclass(frozen=True)
class Task:
    """A task and its protocol."""

    name: str
    state: int
    """Entries of the state."""
    action: int
    """Entries of the action; each lies within -1 and 1."""
    horizon: int
    """Control steps of an episode."""
    reward_min: float
    """Smallest return of the benchmark's data, R_min of Eq. 17."""
    reward_max: float
    """Largest return of the benchmark's data, R_max of Eq. 17."""
    cost_limit: float
    """The paper's cost limit, d of Eq. 1."""
    rate_hz: int
    """Control steps a second."""

    @property
    def has_goal(self) -> bool:
        """Whether an episode can succeed: a goal to reach, a box to push, a button to press."""
        return any(word in self.name for word in ("Goal", "Push", "Button"))

    def reward_normalized(self, reward: float) -> float:
        """Eq. 17 for a reward return."""
        return (reward - self.reward_min) / (self.reward_max - self.reward_min)


def cost_normalized(cost: float, limit: float) -> float:
    """Eq. 17 for a cost return: 1 at the limit.

    At limit 0, 1 is added to both sides, as the benchmark does.
    """
    return cost / limit if limit > 0 else cost + 1


def _read() -> dict[str, Task]:
    table = resources.files("armor_plant").joinpath("tasks.json").read_text()
    return {row["name"]: Task(**row) for row in json.loads(table)}


TASKS = _read()
"""Every task by its name."""
