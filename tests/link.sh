#!/usr/bin/env bash
# Proves the link on the real simulators: the Python package's own tests, then
# an episode of each of the paper's 14 tasks, flown by the host's controller.
#
# Installs the simulators on first use, in target/simulators or in the folder
# that ARMOR_SIMULATORS names, and pytest beside them. Needs CPython 3.10 or
# 3.11, which it installs if it is missing (Debian, as root).
set -euo pipefail
cd "$(dirname "$0")/.."

export ARMOR_SIMULATORS=${ARMOR_SIMULATORS:-$PWD/target/simulators}
PYTEST=$PWD/target/pytest

if ! python3 -c 'import ensurepip, venv' 2>/dev/null; then
    {
        apt-get update
        apt-get install -y --no-install-recommends python3 python3-venv
    } >&2
fi

cargo test --locked -p firmware-sim --test simulators -- --ignored

python=$ARMOR_SIMULATORS/bin/python
[[ -d $PYTEST ]] || "$python" -m pip install --quiet --disable-pip-version-check --target "$PYTEST" pytest==8.4.2
cd firmware-sim/python
PYTHONPATH=$PYTEST:src PYTHONDONTWRITEBYTECODE=1 "$python" -m pytest -p no:cacheprovider
