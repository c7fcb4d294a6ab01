"""Peak memory of a few training steps on a large recording; run by memory.sh.

The peak is the largest resident set of the process, as the kernel counts it
(ru_maxrss): reading the file, preparing it, five steps and two checkpoints.

usage: memory.py TARGET [--data FILE] [--gzip] [OPTIONS OF armor-train fit]
"""

import argparse
import pathlib
import resource
import subprocess
import tempfile

import h5py
import numpy as np

ROWS, STATE, ACTION, EPISODE = 2_000_000, 88, 2, 1000


def make(path, compression):
    """Standard normal states that follow on within an episode; one cost in twenty rows."""
    rng = np.random.default_rng(0)
    aside = path.with_suffix(".part")
    with h5py.File(aside, "w") as file:
        states = [
            file.create_dataset(name, (ROWS, STATE), "f4", chunks=True if compression else None, compression=compression)
            for name in ["observations", "next_observations"]
        ]
        for at in range(0, ROWS, 100 * EPISODE):
            walk = rng.standard_normal((100, EPISODE + 1, STATE), dtype="f4")
            for data, part in zip(states, [walk[:, :-1], walk[:, 1:]]):
                data[at : at + 100 * EPISODE] = part.reshape(-1, STATE)
        file["actions"] = rng.uniform(-1, 1, (ROWS, ACTION)).astype("f4")
        file["rewards"] = rng.standard_normal(ROWS, dtype="f4")
        file["costs"] = (rng.random(ROWS) < 0.05).astype("f4")
        file["terminals"] = np.zeros(ROWS, bool)
        file["timeouts"] = np.arange(1, ROWS + 1) % EPISODE == 0
    aside.rename(path)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("target", type=pathlib.Path)
    parser.add_argument("--data", type=pathlib.Path)
    parser.add_argument("--gzip", action="store_true", help="make a file of compressed chunks")
    options, of_fit = parser.parse_known_args()

    path = options.data
    if path is None:
        path = options.target / "bench-memory" / ("gzip.hdf5" if options.gzip else "plain.hdf5")
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            make(path, "gzip" if options.gzip else None)
    with h5py.File(path) as file:
        observations = 4 * file["observations"].size

    with tempfile.TemporaryDirectory() as folder:
        fit = [options.target / "release/armor-train", "fit", "--preset", "paper", "--task", "random", "--limit", "20"]
        subprocess.run(
            [*fit, "--steps", "5", "--data", path, "--out", f"{folder}/run", *of_fit],
            check=True,
            stdout=subprocess.DEVNULL,
        )
    peak = 1024 * resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    print(f"observations {observations / 1e6:.0f} MB, peak {peak / 1e6:.0f} MB, {peak / observations:.3f} times")


if __name__ == "__main__":
    main()
