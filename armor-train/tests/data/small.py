"""Writes small.hdf5, the DSRL layout as h5py writes it, small enough to damage every byte of,
and claims.hdf5, whose seven data sets claim 2^40 rows but hold none.

Needs h5py and numpy (written with 3.16.0 and 1.26.4). Run in this folder: python3 small.py
"""

import h5py
import numpy as np

ROWS = 12
row = np.arange(ROWS, dtype=np.float32)


def state(t):
    return np.stack([t / 8, t**2, -t], axis=1)


with h5py.File("small.hdf5", "w") as file:
    columns = {
        "observations": state(row),
        "next_observations": state(row + 1),
        "actions": np.stack([row / 16, -row / 16], axis=1),
        "rewards": row / 4,
        "costs": np.float32(row % 3 == 0),
        # Two trajectories of 4 and 5 rows, then 3 rows without an end.
        "terminals": row == 8,
        "timeouts": row == 3,
    }
    for name, values in columns.items():
        file.create_dataset(name, data=values, compression="gzip", chunks=True)

with h5py.File("claims.hdf5", "w", libver="latest") as file:
    for name, values in columns.items():
        file.create_dataset(name, shape=(2**40, *values.shape[1:]), dtype=values.dtype, chunks=(1024, *values.shape[1:]))
