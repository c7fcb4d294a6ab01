#!/usr/bin/env bash
# Proves the controller on microcontrollers: the bare-metal firmware of
# firmware-sim/mcu is built for seven of them, in Rust, and for one in C, and
# under QEMU each flies as this host does, bit for bit, within small memories
# and the instructions that are recorded for it (firmware-sim budgets). The
# emulated Cortex-M4F flies MuJoCo's point robot, too, in the simulators that
# tests/link.sh installs.
#
# It is built with a standard library of which only `core` is there: any use of
# `alloc` or `std` by armor-core, armor-infer or what they depend on would be a
# crate that cannot be found.
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

# It installs the simulators where they are missing.
ARMOR_SIMULATORS=${ARMOR_SIMULATORS:-$PWD/target/simulators} \
    cargo test --locked -p firmware-sim --test simulators -- --ignored emulated
