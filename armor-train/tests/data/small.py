"""Writes the DSRL layout as h5py writes it, small enough to damage every byte of.

small.hdf5 is in the oldest file format (h5py's default), small-v114.hdf5 in that of HDF5 1.14,
newer.hdf5 in that of HDF5 2.0; claims.hdf5 claims 2^40 rows in every data set but holds none.

Needs h5py and numpy (written with 3.16.0 and 1.26.4). Run in this folder: python3 small.py
"""

import h5py
import numpy as np

ROWS = 12
row = np.arange(ROWS, dtype=np.float32)


def state(t):
    return np.stack([t / 8, t**2, -t], axis=1)


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

for name, libver in {"small": "earliest", "small-v114": "v114", "newer": "v200"}.items():
    with h5py.File(f"{name}.hdf5", "w", libver=libver) as file:
        for key, values in columns.items():
            file.create_dataset(key, data=values, compression="gzip", chunks=True)

with h5py.File("claims.hdf5", "w", libver="v114") as file:
    for key, values in columns.items():
        file.create_dataset(key, shape=(2**40, *values.shape[1:]), dtype=values.dtype, chunks=(1024, *values.shape[1:]))
