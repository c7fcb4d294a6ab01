#!/usr/bin/env bash
# Proves that armor-core and armor-infer contain no panic: a firmware that calls
# all of them (tests/no-panic) is linked in release for a Cortex-M4, with both
# number formats and with each alone, and must be without the panic handler, for
# nothing then can call it. That nothing allocates follows from mcu.sh, which
# builds with `core` alone, and is looked for again. A firmware with a panic in it shows that one is found.
#
# Needs a compiler that has its library's source beside it, Debian's rustc-web,
# and the linker for Arm; installs them if they are missing (as root). Prints one line a firmware.
set -euo pipefail
shopt -s inherit_errexit
cd "$(dirname "$0")/no-panic"

TARGET=thumbv7em-none-eabihf
COMPILER=/usr/bin/rustc
SOURCE=/usr/lib/rustlib/src/rust/library/core

if [[ ! -x $COMPILER || ! -d $SOURCE ]] || ! command -v arm-none-eabi-ld >/dev/null; then
    {
        apt-get update
        apt-get install -y --no-install-recommends rustc-web rust-web-src binutils-arm-none-eabi
    } >&2
fi

export RUSTC=$COMPILER RUSTC_BOOTSTRAP=1 CARGO_TARGET_DIR=../../target/no-panic
export CARGO_TARGET_THUMBV7EM_NONE_EABIHF_LINKER=arm-none-eabi-ld
export CARGO_TARGET_THUMBV7EM_NONE_EABIHF_RUSTFLAGS="-Clinker-flavor=ld -Clink-arg=--gc-sections -Clink-arg=--entry=entry"
unset RUSTFLAGS CARGO_ENCODED_RUSTFLAGS CARGO_BUILD_RUSTFLAGS

# The firmware's functions that are, or that call, what ends in a panic or on a heap.
panics() {
    cargo build --quiet --release -Zbuild-std=core --target $TARGET --features "$1" >&2
    arm-none-eabi-objdump --disassemble --demangle --no-show-raw-insn "$CARGO_TARGET_DIR/$TARGET/release/no-panic" |
        awk '/^[0-9a-f]+ <.*>:$/ { name = $0; sub(/^[0-9a-f]+ </, "", name); sub(/>:$/, "", name); functions++ }
             /panicking|rust_begin_unwind|unwrap_failed|expect_failed|__rust_alloc/ { found[name] = 1 }
             END { if (!functions) print "(nothing: the firmware holds no function)"; for (name in found) print name }'
}

failed=0
for features in float,integer float integer; do
    found=$(panics "$features")
    if [[ -n $found ]]; then
        failed=1
        echo "no-panic $features: FAILED, panics in or under:"
        sed 's/^/    /' <<<"$found"
    else
        echo "no-panic $features: ok"
    fi
done
if [[ -z $(panics float,integer,deliberate) ]]; then
    failed=1
    echo "no-panic: FAILED: a deliberate panic was not found"
fi
exit $failed
