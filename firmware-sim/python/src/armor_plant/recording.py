"""DSRL files of what was flown: seven flat data sets, a row a control step."""

import os
import tempfile
from pathlib import Path

import numpy as np

from armor_plant.flight import Episode


def write(path: Path, episodes: list[Episode]) -> None:
    """Write the episodes to an HDF5 file, aside and then renamed.

    ``terminals`` marks the last step of an episode that ended before its time,
    ``timeouts`` that of every other.
    """
    import h5py

    def joined(rows: list[list[float]]) -> "np.ndarray[tuple[int], np.dtype[np.float32]]":
        return np.concatenate([np.asarray(row, np.float32) for row in rows])

    def ends(terminated: bool) -> "np.ndarray[tuple[int], np.dtype[np.bool_]]":
        marks = [np.zeros(len(episode.rewards), bool) for episode in episodes]
        for mark, episode in zip(marks, episodes, strict=True):
            mark[-1] = episode.terminated == terminated
        return np.concatenate(marks)

    columns = {
        "observations": np.concatenate([episode.observations[:-1] for episode in episodes]),
        "next_observations": np.concatenate([episode.observations[1:] for episode in episodes]),
        "actions": np.concatenate(
            [np.array([act.action for act in episode.acts], np.float32) for episode in episodes]
        ),
        "rewards": joined([episode.rewards for episode in episodes]),
        "costs": joined([episode.costs for episode in episodes]),
        "terminals": ends(terminated=True),
        "timeouts": ends(terminated=False),
    }
    descriptor, aside = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=".part")
    os.close(descriptor)
    try:
        with h5py.File(aside, "w") as file:
            for name, column in columns.items():
                file.create_dataset(name, data=column, compression="gzip")
        os.replace(aside, path)
    except BaseException:
        os.unlink(aside)
        raise
