"""A controller that only wanders: smooth random actions, for recordings that go everywhere."""

import math

import numpy as np
from numpy.typing import NDArray

from armor_plant.messages import Act
from armor_plant.tasks import Task

CORRELATION = 0.5
"""Seconds after which an action is forgotten to 1/e."""
DEVIATION = 0.8
"""Standard deviation of an action before it is clipped to -1 and 1."""


class Wanderer:
    """First-order noise, clipped: an action lasts, changes, and often meets its bounds."""

    def __init__(self, task: Task) -> None:
        """Wander with as many entries, and at the rate, of a task."""
        self._entries = task.action
        self._keep = math.exp(-1 / (CORRELATION * task.rate_hz))
        self.reset(task.cost_limit, 0)

    def reset(self, limit: float, seed: int) -> float:
        """Start an episode; its actions are decided by ``seed``."""
        self._noise = np.random.default_rng(seed)
        self._wish = DEVIATION * self._noise.standard_normal(self._entries)
        self._kappa, self._tick = limit, 0
        return limit

    def step(self, state: NDArray[np.float32], incurred: float) -> Act:
        """Return what to do, whatever the state is."""
        fresh = DEVIATION * self._noise.standard_normal(self._entries)
        self._wish = self._keep * self._wish + math.sqrt(1 - self._keep**2) * fresh
        self._kappa = max(0.0, self._kappa - incurred)
        action = tuple(float(entry) for entry in np.clip(self._wish, -1, 1).astype(np.float32))
        act = Act(episode=1, tick=self._tick, kappa=self._kappa, rung=0, fault=None, action=action)
        self._tick += 1
        return act

    def close(self) -> None:
        """Nothing is held."""
