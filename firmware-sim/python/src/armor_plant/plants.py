"""The robots: one interface for both simulators.

An episode is decided by the seed of its reset and the actions alone, however
many were flown before.
"""

import contextlib
import io
import os
import random
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from armor_plant import repairs
from armor_plant.tasks import TASKS, Task

INSTALL = "pip install --no-deps -r firmware-sim/python/simulators.txt"
"""The command that installs the simulators, in the project's folder."""

BULLET = ("SafetyAntRun-v0", "SafetyBallRun-v0", "SafetyDroneRun-v0", "SafetyBallCircle-v0")
"""The tasks of Bullet-Safety-Gym; all others are Safety-Gymnasium's."""


class SimulatorMissingError(Exception):
    """A simulator is not installed; the message says how to do that."""


@dataclass(frozen=True)
class Outcome:
    """What a control step brought."""

    observation: NDArray[np.float32]
    reward: float
    cost: float
    terminated: bool
    """Whether the episode ended before its time."""
    goal: bool
    """Whether a goal was reached."""


class Plant(Protocol):
    """A robot and its task."""

    task: Task

    def reset(self, seed: int) -> NDArray[np.float32]:
        """Start an episode, decided by ``seed`` from 0 to 2^32 - 1."""

    def step(self, action: NDArray[np.float32]) -> Outcome:
        """Hold an action within -1 and 1 for one control step."""


def make(name: str) -> Plant:
    """Make the plant of a task.

    Raises ``KeyError`` where there is no such task, and
    :class:`SimulatorMissingError` where its simulator is not installed.
    """
    task = TASKS[name]
    is_bullet = task.name in BULLET
    try:
        with _quiet():
            _load_gymnasium()
            return BulletPlant(task) if is_bullet else MujocoPlant(task)
    except ModuleNotFoundError as error:
        raise SimulatorMissingError(f"{error}; install the simulators: {INSTALL}") from error


class BulletPlant:
    """A task of Bullet-Safety-Gym."""

    def __init__(self, task: Task) -> None:
        """Load the simulator."""
        import bullet_safety_gym  # noqa: F401 - registers its tasks
        import gymnasium

        self.task = task
        self._env: Any = gymnasium.make(task.name, disable_env_checker=True).unwrapped

    def reset(self, seed: int) -> NDArray[np.float32]:
        """Start an episode."""
        _seed_everything(seed)  # The simulator ignores the seed that it is given.
        if self.task.name == "SafetyDroneRun-v0":
            # Its rotors would start as the last episode left them.
            agent = self._env.agent
            for rotor, hovering in zip(agent.motor_list, agent.hover_velocities, strict=True):
                rotor.set_velocity(hovering)
        observation, _ = self._env.reset()
        return np.asarray(observation, np.float32)

    def step(self, action: NDArray[np.float32]) -> Outcome:
        """Hold an action for one control step."""
        observation, reward, terminated, _, info = self._env.step(action)
        return Outcome(
            observation=np.asarray(observation, np.float32),
            reward=float(reward),
            cost=float(info["cost"]),
            terminated=bool(terminated),
            goal=False,
        )


class MujocoPlant:
    """A task of Safety-Gymnasium."""

    def __init__(self, task: Task) -> None:
        """Load the simulator, mended."""
        with repairs.array_defaults():
            import safety_gymnasium
            from safety_gymnasium import world
        repairs.plain_sky(world)
        self.task = task
        self._env: Any = safety_gymnasium.make(task.name, disable_env_checker=True).unwrapped
        # The first episode after loading is unlike all others, with moving obstacles.
        self.reset(0)

    def reset(self, seed: int) -> NDArray[np.float32]:
        """Start an episode."""
        _seed_everything(seed)
        observation, _ = self._env.reset(seed=seed)
        return np.asarray(observation, np.float32)

    def step(self, action: NDArray[np.float32]) -> Outcome:
        """Hold an action for one control step."""
        observation, reward, cost, terminated, _, info = self._env.step(action)
        return Outcome(
            observation=np.asarray(observation, np.float32),
            reward=float(reward),
            cost=float(cost),
            terminated=bool(terminated),
            goal=bool(info.get("goal_met", False)),
        )


def _load_gymnasium() -> None:
    """Import what both simulators build on, without the news that its plug-ins print."""
    with contextlib.redirect_stderr(io.StringIO()):
        import gymnasium  # noqa: F401


def _seed_everything(seed: int) -> None:
    random.seed(seed)
    np.random.seed(seed)


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Send what the simulators print as they load to stderr: stdout is for results.

    Some of it is printed by C code, so the descriptor itself is redirected.
    """
    sys.stdout.flush()
    kept = os.dup(1)
    try:
        os.dup2(2, 1)
        yield
    finally:
        sys.stdout.flush()
        os.dup2(kept, 1)
        os.close(kept)
