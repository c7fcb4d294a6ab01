"""Scores of a flight (Eq. 17), under the keys that ``firmware-sim run --json`` uses."""

from typing import Any

import numpy as np

from armor_plant.flight import Episode
from armor_plant.tasks import Task, cost_normalized


def summary(task: Task, limit: float, seed: int, episodes: list[Episode]) -> dict[str, Any]:
    """Score the episodes of a flight; deviations are those of the population of episodes."""
    rewards = np.array([sum(episode.rewards) for episode in episodes])
    costs = np.array([sum(episode.costs) for episode in episodes])
    acts = [act for episode in episodes for act in episode.acts]
    trips = 1e6 * np.array([trip for episode in episodes for trip in episode.round_trips])
    scores = {
        "reward": rewards,
        "cost": costs,
        "reward_normalized": np.array([task.reward_normalized(reward) for reward in rewards]),
        "cost_normalized": np.array([cost_normalized(cost, limit) for cost in costs]),
    }
    report: dict[str, Any] = {
        "task": task.name,
        "episodes": len(episodes),
        "seed": seed,
        "rate_hz": task.rate_hz,
        "cost_limit": limit,
    }
    for name, values in scores.items():
        report[name] = float(values.mean())
        report[f"{name}_std"] = float(values.std())
    report["safe_episodes"] = int((costs <= limit).sum())
    report["actions"] = len(acts)
    report["faults"] = sum(act.fault is not None for act in acts)
    if task.has_goal:
        report["success_rate"] = float(np.mean([episode.goals > 0 for episode in episodes]))
        report["goals"] = float(np.mean([episode.goals for episode in episodes]))
    report["round_trip_us_p50"] = float(np.quantile(trips, 0.5))
    report["round_trip_us_p99"] = float(np.quantile(trips, 0.99))
    return report


def text(report: dict[str, Any]) -> str:
    """The scores for people."""
    lines = [
        f"{report['task']}, {report['episodes']} episodes, seed {report['seed']}",
        f"cost limit          {report['cost_limit']:10.2f}",
    ]
    for name, digits in (
        ("reward", 2),
        ("cost", 2),
        ("reward_normalized", 3),
        ("cost_normalized", 3),
    ):
        label = {"reward_normalized": "normalised reward", "cost_normalized": "normalised cost"}
        mean, deviation = report[name], report[f"{name}_std"]
        lines.append(f"{label.get(name, name):20}{mean:10.{digits}f} +- {deviation:.{digits}f}")
    lines.append(f"episodes in limit   {report['safe_episodes']:10} of {report['episodes']}")
    lines.append(f"faults              {report['faults']:10} of {report['actions']} actions")
    if "success_rate" in report:
        rate, goals = report["success_rate"], report["goals"]
        lines.append(f"success             {rate:10.2f} of episodes, {goals:.1f} goals in each")
    median, high = report["round_trip_us_p50"], report["round_trip_us_p99"]
    lines.append(f"round trip          {median:10.1f} us median, {high:.1f} us p99")
    return "\n".join(lines)
