#!/bin/sh
# Peak memory of training at paper size on 2 million transitions of 88 state and
# 2 action entries, against the size of their observations (memory.py).
#
#   bench/memory.sh [--data FILE] [--gzip] [OPTIONS OF armor-train fit]
#
# Without --data, a file of random numbers is made in target/bench-memory (1.4 GB)
# and kept there. ARMOR_H5PY_PYTHON names a Python that has h5py; without it, one
# is made in target/bench-h5py. Linux only, as it asks the kernel for the peak.
set -eu
cd "$(dirname "$0")/.."
target="${CARGO_TARGET_DIR:-target}"
python="${ARMOR_H5PY_PYTHON:-$target/bench-h5py/bin/python}"
if [ -z "${ARMOR_H5PY_PYTHON:-}" ] && ! "$python" -c 'import h5py' 2>/dev/null; then
    python3 -m venv "$target/bench-h5py"
    "$python" -m pip install --quiet h5py
fi
cargo build --release --quiet -p armor-train
exec "$python" bench/memory.py "$target" "$@"
