"""Smooth random actions in place of a controller."""

import numpy as np

from armor_plant.tasks import TASKS
from armor_plant.wander import CORRELATION, DEVIATION, Wanderer

TASK = TASKS["SafetyPointGoal1-v0"]
STATE = np.zeros(TASK.state, np.float32)


def actions(seed: int, steps: int) -> "np.ndarray[tuple[int, int], np.dtype[np.float64]]":
    wanderer = Wanderer(TASK)
    wanderer.reset(TASK.cost_limit, seed)
    return np.array([wanderer.step(STATE, 0.0).action for _ in range(steps)])


def test_a_seed_decides_the_actions_and_the_bounds_hold() -> None:
    first = actions(1, 200)
    assert (actions(1, 200) == first).all()
    assert (actions(2, 200) != first).any()
    assert np.abs(first).max() == 1.0


def test_actions_have_their_spread_and_are_forgotten_at_their_rate() -> None:
    found = actions(3, 200_000)
    # A normal entry is within its bounds in 2 Phi(1 / 0.8) - 1 of all steps.
    assert abs((np.abs(found) < 1).mean() - 0.7887) < 0.02
    # From so far inside the next step meets no bound.
    inside = np.abs(found).max(axis=1) < 0.3
    now, then = found[:-1][inside[:-1]], found[1:][inside[:-1]]
    keep = float((now * then).sum() / (now * now).sum())
    assert DEVIATION == 0.8 and CORRELATION == 0.5
    assert abs(keep - np.exp(-1 / 25)) < 0.01


def test_the_budget_is_kept_as_a_controller_would() -> None:
    wanderer = Wanderer(TASK)
    wanderer.reset(2.5, 0)
    kappas = [wanderer.step(STATE, incurred).kappa for incurred in (0.0, 1.0, 1.0, 1.0)]
    assert kappas == [2.5, 1.5, 0.5, 0.0]
