#!/bin/sh
# What an action takes on this host: the 20-step chain at state 60, action 2 and
# hidden 256, ours in all precisions against onnxruntime, tract, candle and
# PyTorch on the same network, interleaved, on one thread (latency.py).
#
#   bench/latency.sh [--rounds 30] [--actions 30]
#
# ARMOR_PEERS_PYTHON names a Python that has torch, onnx, onnxruntime and tract; without
# it, one is made in target/bench-peers. Meant for a machine that does nothing
# else meanwhile; the load is printed with the table.
set -eu
cd "$(dirname "$0")/.."
target="${CARGO_TARGET_DIR:-$PWD/target}"
python="${ARMOR_PEERS_PYTHON:-$target/bench-peers/bin/python}"
if [ -z "${ARMOR_PEERS_PYTHON:-}" ] && ! "$python" -c 'import onnxruntime, torch, tract' 2>/dev/null; then
    python3 -m venv "$target/bench-peers"
    "$python" -m pip install --quiet numpy onnx==1.23.2 onnxruntime==1.32.0 torch==2.15.0 tract==0.23.9
fi
if [ ! -f "$target/bench-latency/int8.armor" ]; then
    cargo run --release --quiet -p armor-train --example sized_policies -- "$target/bench-latency"
fi
CARGO_TARGET_DIR="$target/peers" cargo build --release --quiet --locked --manifest-path bench/peers/Cargo.toml
exec "$python" bench/latency.py "$target/peers/release" "$target/bench-latency" "$@"
