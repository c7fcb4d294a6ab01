#!/usr/bin/env bash
# Proves the controller on microcontrollers: the bare-metal firmware of
# firmware-sim/mcu is built for seven of them, in Rust, and for one in C, and
# under QEMU each flies as this host does, bit for bit, within small memories
# and the instructions that are recorded for it (firmware-sim budgets).
# Where the simulators of tests/link.sh are there, the emulated Cortex-M4F flies
# MuJoCo's point robot, too.
#
# Installs a compiler with its library's source, QEMU and Arm's C compiler if
# they are missing (Debian, as root).
set -euo pipefail
cd "$(dirname "$0")/.."

missing=()
need() {
    command -v "$1" >/dev/null || [[ -e $1 ]] || missing+=("${@:2}")
}
need /usr/bin/rustc rustc-web
need /usr/lib/rustlib/src/rust/library/core rust-web-src
need qemu-system-arm qemu-system-arm
need qemu-system-riscv32 qemu-system-misc
need arm-none-eabi-gcc gcc-arm-none-eabi
need /usr/lib/arm-none-eabi/newlib libnewlib-arm-none-eabi
need cc gcc libc6-dev
# rustup has a linker for all of them, Debian's compiler has not.
[[ -n $(find "$(rustc --print sysroot 2>/dev/null)/lib/rustlib" -path '*/bin/rust-lld' 2>/dev/null) ]] || need ld.lld lld
if ((${#missing[@]})); then
    {
        apt-get update
        apt-get install -y --no-install-recommends "${missing[@]}"
    } >&2
fi

firmware-sim/mcu/build.sh all

export ARMOR_FIRMWARE=$PWD/target/mcu
cargo test --locked -p armor-tests --test across -- --ignored --nocapture mcu

cargo run --quiet --locked -p firmware-sim -- budgets --machine all --firmware "$ARMOR_FIRMWARE"

export ARMOR_SIMULATORS=${ARMOR_SIMULATORS:-$PWD/target/simulators}
if [[ -x $ARMOR_SIMULATORS/bin/python ]]; then
    cargo test --locked -p firmware-sim --test simulators -- --ignored emulated
else
    echo "mcu: no simulators in $ARMOR_SIMULATORS: run tests/link.sh first to fly MuJoCo's point robot on the emulated Cortex-M4F"
    exit 1
fi
