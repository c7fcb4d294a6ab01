"""Counts the shipped recording with h5py and numpy alone; shipped.rs asserts what this prints.

Needs h5py and numpy (run with 3.16.0 and 1.26.4). Run in this folder: python3 shipped.py
"""

import h5py
import numpy as np

with h5py.File("../../../data/ball-run-bullet.hdf5") as file:
    data = {name: file[name][:] for name in file}

ends = np.flatnonzero(data["terminals"] | data["timeouts"]) + 1
pieces = list(zip(np.r_[0, ends[:-1]], ends))
rewards = np.array([data["rewards"][a:b].astype(np.float64).sum() for a, b in pieces])
costs = np.array([data["costs"][a:b].astype(np.float64).sum() for a, b in pieces])
feasible = costs <= 5
kappa = np.concatenate([np.cumsum(data["costs"][a:b][::-1].astype(np.float64))[::-1] for a, b in pieces])

print("transitions", ends[-1], "of", len(data["costs"]), "trajectories", len(ends))
print("p_nz", np.mean(data["costs"] > 0))
print("p_feas", feasible.mean())
print("horizon", min(b - a for a, b in pieces), max(b - a for a, b in pieces))
print("reward return 5/50/95/100 %", *map(float, np.percentile(rewards, [5, 50, 95, 100])))
print("cost return 25/50/75/100 %", *map(float, np.percentile(costs, [25, 50, 75, 100])))
print("best feasible return", rewards[feasible].max())
print("sum of kappa", kappa.sum())
print("state mean", *data["observations"].astype(np.float64).mean(axis=0))
print("state std", *data["observations"].astype(np.float64).std(axis=0))
