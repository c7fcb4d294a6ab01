"""Episodes: a plant flown by a controller."""

import time
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from armor_plant.messages import Act
from armor_plant.plants import Plant


class Controller(Protocol):
    """What answers states with actions: the other end of a link, or a stand-in."""

    def reset(self, limit: float, seed: int) -> float:
        """Start an episode that may incur ``limit``; return its budget."""

    def step(self, state: NDArray[np.float32], incurred: float) -> Act:
        """Tell the state and the cost of the step before; return what to do."""

    def close(self) -> None:
        """Let go of it."""


@dataclass(frozen=True)
class Seeds:
    """What decides an episode."""

    plant: int
    """Where it starts, below 2^32."""
    noise: int
    """The controller's noise, below 2^64."""

    @classmethod
    def of(cls, seed: int, episode: int) -> "Seeds":
        """The seeds of an episode of a flight, independent of how many others are flown."""
        plant, low, high = np.random.SeedSequence((seed, episode)).generate_state(3, np.uint32)
        return cls(plant=int(plant), noise=int(high) << 32 | int(low))


@dataclass
class Episode:
    """An episode that was flown, a row a control step."""

    observations: list[NDArray[np.float32]] = field(default_factory=list)
    """One more than there are steps: the last is where the episode ended."""
    acts: list[Act] = field(default_factory=list)
    rewards: list[float] = field(default_factory=list)
    costs: list[float] = field(default_factory=list)
    goals: int = 0
    """Goals reached."""
    terminated: bool = False
    """Whether it ended before its time."""
    round_trips: list[float] = field(default_factory=list)
    """Seconds from a state to its action, the line and both codecs included."""


def fly(plant: Plant, client: Controller, limit: float, seeds: Seeds, steps: int) -> Episode:
    """Fly an episode of at most ``steps`` control steps that may incur ``limit``."""
    episode = Episode()
    observation = plant.reset(seeds.plant)
    episode.observations.append(observation)
    client.reset(limit, seeds.noise)
    incurred = 0.0
    for _ in range(steps):
        started = time.perf_counter()
        act = client.step(observation, incurred)
        episode.round_trips.append(time.perf_counter() - started)

        outcome = plant.step(np.asarray(act.action, np.float32))
        observation, incurred = outcome.observation, outcome.cost
        episode.observations.append(observation)
        episode.acts.append(act)
        episode.rewards.append(outcome.reward)
        episode.costs.append(outcome.cost)
        episode.goals += outcome.goal
        if outcome.terminated:
            episode.terminated = True
            break
    return episode
