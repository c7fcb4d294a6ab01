"""Both simulators, behind one interface; skipped where they are not installed."""

import importlib
import sys

import numpy as np
import pytest

pytest.importorskip("mujoco")
pytest.importorskip("pybullet")

from armor_plant import plants, repairs
from armor_plant.tasks import TASKS

STEPS = 20


def flown(plant: plants.Plant, seed: int) -> list[tuple[bytes, float, float]]:
    """Observation, reward and cost of an episode's first steps under scripted actions."""
    rows = [(plant.reset(seed).tobytes(), 0.0, 0.0)]
    for step in range(STEPS):
        action = np.sin(0.7 * step + np.arange(plant.task.action)).astype(np.float32)
        outcome = plant.step(action)
        rows.append((outcome.observation.tobytes(), outcome.reward, outcome.cost))
    return rows


@pytest.mark.parametrize("name", sorted(TASKS))
def test_an_episode_is_decided_by_its_seed_however_many_were_flown(name: str) -> None:
    task = TASKS[name]
    plant = plants.make(name)
    assert plant.reset(0).shape == (task.state,)
    first = flown(plant, 5)
    other = flown(plant, 6)
    assert first != other
    assert flown(plant, 5) == first
    assert flown(plants.make(name), 5) == first
    assert all(cost in (0.0, 1.0) for _, _, cost in first)


def test_the_plain_sky_changes_nothing_but_time() -> None:
    plain = flown(plants.make("SafetyPointGoal1-v0"), 5)
    # The simulator as it came, imported anew.
    for module in [name for name in sys.modules if name.startswith("safety_gymnasium")]:
        del sys.modules[module]
    with repairs.array_defaults():
        simulator = importlib.import_module("safety_gymnasium")
    plant = plants.MujocoPlant.__new__(plants.MujocoPlant)
    plant.task = TASKS["SafetyPointGoal1-v0"]
    plant._env = simulator.make(plant.task.name, disable_env_checker=True).unwrapped
    plant.reset(0)
    assert flown(plant, 5) == plain


def test_array_defaults_are_allowed_for_as_long_as_it_says() -> None:
    import dataclasses

    def define() -> type:
        @dataclasses.dataclass
        class Point:
            position: np.ndarray = np.zeros(2)  # type: ignore[type-arg]  # noqa: RUF009

        return Point

    with repairs.array_defaults():
        assert define()().position.tolist() == [0.0, 0.0]
        with pytest.raises(ValueError, match="mutable default"):

            @dataclasses.dataclass
            class Wrong:
                position: list[float] = []  # noqa: RUF008

    if sys.version_info >= (3, 11):
        with pytest.raises(ValueError, match="mutable default"):
            define()
