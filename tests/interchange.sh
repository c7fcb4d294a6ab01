#!/usr/bin/env bash
# Proves that policies leave for other runtimes and come from them: a trained
# policy's graph runs in onnxruntime with the controller's actions, and a
# policy that PyTorch trained becomes an image that passes every check.
#
# Installs onnxruntime on first use, in target/interchange, and Python if it is
# missing (Debian, as root).
set -euo pipefail
cd "$(dirname "$0")/.."

venv=$PWD/target/interchange
if ! python3 -c 'import ensurepip, venv' 2>/dev/null; then
    {
        apt-get update
        apt-get install -y --no-install-recommends python3 python3-venv
    } >&2
fi
if ! "$venv/bin/python" -c 'import onnxruntime' 2>/dev/null; then
    python3 -m venv "$venv"
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check onnxruntime numpy
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cargo build --quiet --locked -p armor-train -p firmware-sim
bin=${CARGO_TARGET_DIR:-target}/debug

"$bin/armor-train" fit --data data/ball-run-bullet.hdf5 --task ball-run --limit 5 --preset quick --steps 60 \
    --set hidden=32 --set trunk=16 --out "$work/run" 2>/dev/null >/dev/null
"$bin/armor-train" export "$work/run" --critic --onnx "$work/policy.onnx" -o "$work/policy.armor" 2>/dev/null
"$bin/firmware-sim" verify "$work/policy.armor" >/dev/null
echo 0.02, -0.1, 0.3, 0.05, 0.02, 0.6, 0 >"$work/state"
"$bin/firmware-sim" trace "$work/policy.armor" --state "$work/state" --kappa 3.5 --seed 9 --json >"$work/trace.json" 2>/dev/null
"$venv/bin/python" armor-train/tests/interchange/onnx_chain.py "$work/policy.onnx" "$work/trace.json"

tests=armor-train/tests/interchange
"$bin/armor-train" import $tests/policy.safetensors --description $tests/policy.toml -o "$work/elsewhere.armor" >/dev/null
"$bin/firmware-sim" verify "$work/elsewhere.armor" >/dev/null
echo "interchange: a policy of PyTorch's is an image that passes every check"
