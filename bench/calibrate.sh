#!/usr/bin/env bash
# Holds the four native plants against their simulators: records smooth random
# actions in each, and compares one step and whole episodes. docs/simulators.md
# has the figures.
#
#     bench/calibrate.sh [FOLDER]
#
# Recordings go to FOLDER, target/calibration if none is named. Needs the
# simulators: `armor-train evaluate` or tests/link.sh installs them in the folder
# that ARMOR_SIMULATORS names, target/simulators if it is not set.
set -euo pipefail
cd "$(dirname "$0")/.."

folder=${1:-target/calibration}
python=${ARMOR_SIMULATORS:-$PWD/target/simulators}/bin/python
[[ -x $python ]] || { echo "no simulators in ${python%/bin/python}; run tests/link.sh first" >&2; exit 1; }
mkdir -p "$folder"
cargo build --release --locked -p armor-train --bin armor-train

record() {
    local name=$1 episodes=$2 steps=$3
    PYTHONPATH=firmware-sim/python/src "$python" -m armor_plant "$name" --wander --seed 1 \
        --episodes "$episodes" --steps "$steps" --record "$folder/$name.hdf5" >&2
}

# Long enough to go everywhere, short enough to stay in the lidar's range and within the walls.
record SafetyBallRun-v0 100 100
record SafetyBallCircle-v0 500 20
record SafetyPointCircle1-v0 200 150
record SafetyPointGoal1-v0 100 150
for pair in ball-circle:SafetyBallCircle-v0 point-goal:SafetyPointGoal1-v0; do
    "$python" bench/told_rows.py "${pair%:*}" "$folder/${pair#*:}.hdf5" "$folder/${pair%:*}.hdf5"
done
for pair in ball-run:SafetyBallRun-v0 ball-circle:ball-circle point-circle:SafetyPointCircle1-v0 \
    point-goal:point-goal point-goal:SafetyPointGoal1-v0; do
    target/release/armor-train data calibrate "$folder/${pair#*:}.hdf5" --task "${pair%:*}"
done
