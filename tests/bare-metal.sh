#!/usr/bin/env bash
# Proves that armor-core and armor-infer are no_std without alloc: each builds
# alone, in release, for bare-metal targets, with a standard library of which
# only `core` was built. Any use of `alloc` or `std`, by them or by what they
# depend on, is a crate that cannot be found.
#
# Needs a compiler that has its library's source beside it: Debian's rustc-web,
# installed here if it is missing (as root). Prints one line a target.
set -euo pipefail
cd "$(dirname "$0")/.."

TARGETS=(thumbv7em-none-eabihf riscv32imac-unknown-none-elf)
CRATES=(armor-core armor-infer)
COMPILER=/usr/bin/rustc
SOURCE=/usr/lib/rustlib/src/rust/library/core

if [[ ! -x $COMPILER || ! -d $SOURCE ]]; then
    {
        apt-get update
        apt-get install -y --no-install-recommends rustc-web rust-web-src
    } >&2
fi

# The library's source builds with the compiler it belongs to, and `-Z` with
# RUSTC_BOOTSTRAP. Flags meant for the host do not apply.
export RUSTC=$COMPILER RUSTC_BOOTSTRAP=1 CARGO_TARGET_DIR=target/bare-metal
unset RUSTFLAGS CARGO_ENCODED_RUSTFLAGS CARGO_BUILD_RUSTFLAGS

failed=0
for target in "${TARGETS[@]}"; do
    verdict=ok
    for crate in "${CRATES[@]}"; do
        # One crate a call, so that no other crate's features are joined in.
        if ! cargo build --quiet --locked --release -Zbuild-std=core --target "$target" -p "$crate" >&2; then
            verdict="FAILED: $crate does not build with core alone"
            failed=1
        fi
    done
    echo "bare-metal $target: $verdict"
done
exit $failed
