#!/bin/sh
# Times one full paper-size training step of ours and of PyTorch's, interleaved,
# and prints the table of ratios (train_step.py says how it measures).
#
#   bench/train_step.sh [--rounds 7] [--steps 3] [--warmup 200] [--threads 1 2]
#
# ARMOR_TORCH_PYTHON names a Python that has torch; without it, one is made in
# target/bench-venv. Meant for a machine that does nothing else meanwhile.
set -eu
cd "$(dirname "$0")/.."
target="${CARGO_TARGET_DIR:-target}"
python="${ARMOR_TORCH_PYTHON:-$target/bench-venv/bin/python}"
if [ -z "${ARMOR_TORCH_PYTHON:-}" ] && ! "$python" -c 'import torch' 2>/dev/null; then
    python3 -m venv "$target/bench-venv"
    "$python" -m pip install --quiet torch==2.2.2 "numpy<2"
fi
cargo build --release --quiet -p armor-train --example bench_step
exec "$python" bench/train_step.py "$target/release/examples/bench_step" "$@"
