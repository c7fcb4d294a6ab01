#!/usr/bin/env bash
# Builds the bare-metal firmware for the named boards into target/mcu/BOARD.elf,
# and with the check of its kernels, which no flight needs, into BOARD-check.elf;
# `c` is the firmware in C for mps2-an386, and `all` is all of them. Needs Debian's rustc-web and rust-web-src, whose library
# source builds `core` for any target, and a linker: rustup's rust-lld or lld.
#
#     firmware-sim/mcu/build.sh [BOARD...|c|all]
set -euo pipefail
cd "$(dirname "$0")"

COMPILER=/usr/bin/rustc
SOURCE=/usr/lib/rustlib/src/rust/library/core
OUT=$(cd ../.. && pwd)/target/mcu
ALL=(mps2-an385 mps2-an386 mps2-an500 mps2-an505 mps3-an547 rv32imac rv32imafc)

if [[ ! -x $COMPILER || ! -d $SOURCE ]]; then
    echo "error: the firmware needs apt-get install rustc-web rust-web-src" >&2
    exit 1
fi
# Where rustup puts it; a shell that is not a login shell may not look there.
[[ -x ${CARGO_HOME:-$HOME/.cargo}/bin/cargo ]] && PATH=${CARGO_HOME:-$HOME/.cargo}/bin:$PATH
host=$(command -v rustc >/dev/null && rustc --print sysroot || true)
linker=$(find "$host/lib/rustlib" -path '*/bin/rust-lld' -print -quit 2>/dev/null || true)
linker=${linker:-$(command -v ld.lld || true)}
if [[ -z $linker ]]; then
    echo "error: the firmware needs a linker: apt-get install lld" >&2
    exit 1
fi

# The library's source builds with the compiler it belongs to, and `-Z` with
# RUSTC_BOOTSTRAP. Flags meant for the host do not apply.
export RUSTC=$COMPILER RUSTC_BOOTSTRAP=1 CARGO_TARGET_DIR=$OUT
unset RUSTFLAGS CARGO_ENCODED_RUSTFLAGS CARGO_BUILD_RUSTFLAGS

# Sets `target`, `cpu` and `map` for a board.
describe() {
    case $1 in
        mps2-an385) target=thumbv6m-none-eabi cpu=cortex-m0 map=mps2 ;;
        mps2-an386) target=thumbv7em-none-eabihf cpu=cortex-m4 map=mps2 ;;
        mps2-an500) target=thumbv7em-none-eabihf cpu=cortex-m7 map=mps2 ;;
        mps2-an505) target=thumbv8m.main-none-eabihf cpu=cortex-m33 map=an505 ;;
        mps3-an547) target=thumbv8m.main-none-eabihf cpu=cortex-m55 map=an547 ;;
        rv32imac) target=riscv32imac-unknown-none-elf cpu=generic-rv32 map=virt ;;
        rv32imafc) target=riscv32imafc-unknown-none-elf cpu=generic-rv32 map=virt ;;
        *)
            echo "error: no board $1; choose from ${ALL[*]} c" >&2
            exit 2
            ;;
    esac
}

# Builds a package; the core's own instructions go to our crates alone, so that
# boards of one target share its `core`.
package() {
    local package=$1 core="'-Ctarget-cpu=$cpu'"
    # Its vectors of floats flush subnormal numbers to zero (docs/numerics.md); those of integers stay.
    [[ $cpu != cortex-m55 ]] || core+=", '-Ctarget-feature=-mve.fp'"
    local link="'-Clink-arg=-L$PWD/boards/$map', '-Clink-arg=-Tlink.x'"
    local variable=${target^^}
    shift
    env "CARGO_TARGET_${variable//[-.]/_}_LINKER=$linker" \
        cargo build --quiet --locked --release -Zbuild-std=core -Zprofile-rustflags --target "$target" \
        --config "profile.release.package.armor-core.rustflags=[$core]" \
        --config "profile.release.package.armor-infer.rustflags=[$core]" \
        --config "profile.release.package.armor-mcu-c.rustflags=[$core]" \
        --config "profile.release.package.armor-mcu.rustflags=[$core, $link]" \
        --package "$package" "$@"
}

rust_firmware() {
    local feature=$1
    [[ $map == virt ]] && feature=virt
    package armor-mcu --features "$feature"
    cp "$OUT/$target/release/armor-mcu" "$OUT/$1.elf.part"
    mv "$OUT/$1.elf.part" "$OUT/$1.elf"
    package armor-mcu --features "$feature,check"
    cp "$OUT/$target/release/armor-mcu" "$OUT/$1-check.elf.part"
    mv "$OUT/$1-check.elf.part" "$OUT/$1-check.elf"
}

c_firmware() {
    command -v arm-none-eabi-gcc >/dev/null || {
        echo "error: the firmware in C needs apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi" >&2
        exit 1
    }
    package armor-mcu-c --features cortex-m4
    local example=../../armor-infer/examples/c
    arm-none-eabi-gcc -std=c11 -O2 -Wall -Wextra -Wpedantic -Werror -ffp-contract=off -ffunction-sections \
        -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 --specs=nano.specs --specs=nosys.specs \
        -I../../armor-infer/include -I$example -Ic c/main.c c/board.c $example/ball_run.c \
        "$OUT/$target/release/libarmor.a" -nostartfiles -Wl,--gc-sections -Lboards/$map -Tc/link.ld -lm \
        -o "$OUT/c.elf.part"
    mv "$OUT/c.elf.part" "$OUT/c.elf"
}

[[ ${1-all} == all ]] && set -- "${ALL[@]}" c
for board; do
    if [[ $board == c ]]; then
        describe mps2-an386
        c_firmware
    else
        describe "$board"
        rust_firmware "$board"
    fi
    echo "firmware $board: built"
done
