#!/usr/bin/env bash
# Proves the link on the real simulators: an episode of each of the paper's 14
# tasks, flown by the host's controller, then the Python package's own tests,
# types and style.
#
# Installs the simulators on first use, in target/simulators or in the folder
# that ARMOR_SIMULATORS names, and the tools of the tests in target/python-tools. Needs CPython 3.10 or
# 3.11, which it installs if it is missing (Debian, as root).
set -euo pipefail
cd "$(dirname "$0")/.."

export ARMOR_SIMULATORS=${ARMOR_SIMULATORS:-$PWD/target/simulators}
TOOLS=$PWD/target/python-tools

if ! python3 -c 'import ensurepip, venv' 2>/dev/null; then
    {
        apt-get update
        apt-get install -y --no-install-recommends python3 python3-venv
    } >&2
fi

# What needs an emulator, too, is for tests/mcu.sh.
cargo test --locked -p firmware-sim --test simulators -- --ignored --skip emulated

python=$ARMOR_SIMULATORS/bin/python
if [[ ! -d $TOOLS ]]; then
    rm -rf "$TOOLS.part"
    "$python" -m pip install --quiet --disable-pip-version-check --no-warn-conflicts \
        --target "$TOOLS.part" pytest==8.4.2 mypy==2.4.1 ruff==0.17.6
    mv "$TOOLS.part" "$TOOLS"
fi
cd firmware-sim/python
export PYTHONPATH=$TOOLS:src PYTHONDONTWRITEBYTECODE=1
"$python" -m pytest -p no:cacheprovider
"$python" -m mypy --cache-dir /dev/null
"$python" -m ruff check --no-cache
