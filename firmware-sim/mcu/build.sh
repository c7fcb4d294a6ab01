#!/usr/bin/env bash
# Builds the bare-metal firmware for the named boards, or for all of them, into
# target/mcu/BOARD.elf. Needs Debian's rustc-web and rust-web-src, whose library
# source builds `core` for any target, and a linker: rustup's rust-lld or lld.
#
#     firmware-sim/mcu/build.sh [BOARD...]
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

build() {
    local board=$1 feature=$1 map target cpu core link flags variable
    case $board in
        mps2-an385) target=thumbv6m-none-eabi cpu=cortex-m0 map=mps2 ;;
        mps2-an386) target=thumbv7em-none-eabihf cpu=cortex-m4 map=mps2 ;;
        mps2-an500) target=thumbv7em-none-eabihf cpu=cortex-m7 map=mps2 ;;
        mps2-an505) target=thumbv8m.main-none-eabihf cpu=cortex-m33 map=an505 ;;
        mps3-an547) target=thumbv8m.main-none-eabihf cpu=cortex-m55 map=an547 ;;
        rv32imac) target=riscv32imac-unknown-none-elf cpu=generic-rv32 map=virt feature=virt ;;
        rv32imafc) target=riscv32imafc-unknown-none-elf cpu=generic-rv32 map=virt feature=virt ;;
        *)
            echo "error: no board $board; choose from ${ALL[*]}" >&2
            exit 2
            ;;
    esac
    # The core's own instructions go to our crates alone, so that boards of one
    # target share its `core`.
    core="'-Ctarget-cpu=$cpu'"
    # Its vectors of floats flush subnormal numbers to zero (docs/numerics.md); those of integers stay.
    [[ $cpu != cortex-m55 ]] || core+=", '-Ctarget-feature=-mve.fp'"
    link="'-Clink-arg=-L$PWD/boards/$map', '-Clink-arg=-Tlink.x'"
    flags=(
        -Zprofile-rustflags
        --config "profile.release.package.armor-core.rustflags=[$core]"
        --config "profile.release.package.armor-infer.rustflags=[$core]"
        --config "profile.release.package.armor-mcu.rustflags=[$core, $link]"
    )
    variable=${target^^}
    variable=CARGO_TARGET_${variable//[-.]/_}_LINKER
    env "$variable=$linker" cargo build --quiet --locked --release -Zbuild-std=core --target "$target" \
        --features "$feature" "${flags[@]}"
    cp "$OUT/$target/release/armor-mcu" "$OUT/$board.elf.part"
    mv "$OUT/$board.elf.part" "$OUT/$board.elf"
}

for board in "${@:-${ALL[@]}}"; do
    build "$board"
    echo "firmware $board: built"
done
