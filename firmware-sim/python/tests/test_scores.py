"""Scores, seeds and recordings of episodes that nobody flew."""

from pathlib import Path

import numpy as np
import pytest

from armor_plant import recording, report
from armor_plant.flight import Episode, Seeds
from armor_plant.messages import Act
from armor_plant.tasks import TASKS, cost_normalized

TASK = TASKS["SafetyPointGoal1-v0"]


def episode(rewards: list[float], costs: list[float], goals: int, terminated: bool) -> Episode:
    """An episode of two state and two action entries."""
    steps = len(rewards)
    return Episode(
        observations=[np.array([step, -step], np.float32) for step in range(steps + 1)],
        acts=[Act(1, step, 5.0, 0, None, (0.5, step / 8)) for step in range(steps)],
        rewards=rewards,
        costs=costs,
        goals=goals,
        terminated=terminated,
        round_trips=[1e-4] * steps,
    )


EPISODES = [episode([1.0, 2.0, 3.0], [1.0, 0.0, 1.0], 2, False), episode([2.0], [0.0], 0, True)]


def test_scores_are_means_over_episodes_and_eq_17() -> None:
    scores = report.summary(TASK, 1.0, 3, EPISODES)
    assert (scores["reward"], scores["reward_std"]) == (4.0, 2.0)
    # (4 - 0.0119601) / (30.071115 - 0.0119601), by hand.
    assert scores["reward_normalized"] == pytest.approx(0.132673054624)
    assert (scores["cost"], scores["cost_normalized"], scores["safe_episodes"]) == (1.0, 1.0, 1)
    assert (scores["success_rate"], scores["goals"]) == (0.5, 1.0)
    assert (scores["actions"], scores["faults"]) == (4, 0)
    assert scores["round_trip_us_p50"] == pytest.approx(100.0)
    assert all(len(line) <= 80 for line in report.text(scores).splitlines())
    assert cost_normalized(2.0, 0.0) == 3.0


def test_a_task_without_a_goal_has_no_success() -> None:
    assert "success_rate" not in report.summary(TASKS["SafetyPointCircle1-v0"], 1.0, 3, EPISODES)


def test_seeds_are_fixed_for_ever() -> None:
    words = np.random.SeedSequence((7, 3)).generate_state(3, np.uint32)
    assert Seeds.of(7, 3) == Seeds(int(words[0]), int(words[2]) << 32 | int(words[1]))
    assert Seeds.of(0, 0) == Seeds(plant=2968811710, noise=3202545636409661415)
    assert len({Seeds.of(seed, number) for seed in range(30) for number in range(30)}) == 900


def test_a_recording_has_the_dsrl_layout(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "flight.hdf5"
    recording.write(path, EPISODES)
    with h5py.File(path) as file:
        data = {name: file[name][()] for name in file}
    assert {name: column.shape for name, column in data.items()} == {
        "observations": (4, 2),
        "next_observations": (4, 2),
        "actions": (4, 2),
        "rewards": (4,),
        "costs": (4,),
        "terminals": (4,),
        "timeouts": (4,),
    }
    assert data["observations"][:, 0].tolist() == [0, 1, 2, 0]
    assert data["next_observations"][:, 0].tolist() == [1, 2, 3, 1]
    assert data["rewards"].tolist() == [1, 2, 3, 2]
    assert data["terminals"].tolist() == [False, False, False, True]
    assert data["timeouts"].tolist() == [False, False, True, False]
    assert [entry.name for entry in tmp_path.iterdir()] == ["flight.hdf5"]
