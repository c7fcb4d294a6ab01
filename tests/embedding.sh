#!/usr/bin/env bash
# Proves that the controller is at home in other programs: the C header is that
# of the code, a C program flies an episode with the bits of the Rust
# controller and reaches no panic, and so do a plain and an async loop in Rust.
#
# Needs a C compiler and cbindgen, which it installs (Debian, as root).
set -euo pipefail
cd "$(dirname "$0")/.."

if ! { cbindgen --version && make --version && command -v cc nm; } >/dev/null 2>&1; then
    {
        apt-get update
        apt-get install -y --no-install-recommends cbindgen-web make gcc libc6-dev binutils
    } >&2
fi

# The header, as `tests/embedding.sh --header` writes it.
header=armor-infer/include/armor.h
made=$(mktemp)
trap 'rm -f "$made"' EXIT
cbindgen --quiet --config armor-infer/cbindgen.toml --output "$made" armor-infer 2>/dev/null
if [[ ${1-} == --header ]]; then
    cp "$made" $header
    exit
fi
diff -u $header "$made" || { echo "embedding: $header is stale: tests/embedding.sh --header"; exit 1; }
echo "embedding: $header is that of the code"

make --silent -C armor-infer/examples/c
# The linker leaves out what nothing calls: where the handler is gone, no call can panic.
if nm target/c/fly | grep -E 'panic|rust_begin_unwind'; then
    echo "embedding: the C program can reach a panic"
    exit 1
fi
echo "embedding: no panic is linked into the C program"

cargo build --locked -p armor-infer --examples
ARMOR_C=$PWD/target/c ARMOR_EXAMPLES=$PWD/${CARGO_TARGET_DIR:-target}/debug/examples \
    cargo test --locked -p armor-tests --test across -- --ignored embedding
