#!/usr/bin/env bash
# Runs every test of the workspace: units, documentation, integration, the
# command lines, the simulators over the link, and emulated microcontrollers.
# Installs a compiler if there is none (Debian, as root). Prints one line for
# each part, and ends at the first that fails.
set -euo pipefail
cd "$(dirname "$0")/.."

part() {
    local name=$1 start=$SECONDS
    shift
    echo "tests: $name"
    "$@" || { echo "tests: $name FAILED after $((SECONDS - start)) s"; exit 1; }
    echo "tests: $name passed in $((SECONDS - start)) s"
}

install_compiler() {
    apt-get update &&
        apt-get install -y --no-install-recommends cargo-web rustc-web gcc libc6-dev
} >&2

# Where rustup puts it; a shell that is not a login shell may not look there.
[[ -x ${CARGO_HOME:-$HOME/.cargo}/bin/cargo ]] && PATH=${CARGO_HOME:-$HOME/.cargo}/bin:$PATH
if ! { command -v cargo && command -v cc; } >/dev/null; then
    part "installing a compiler" install_compiler
fi

part "workspace" cargo test --workspace --locked --no-fail-fast
# The same build again, for what its tests print: how many writes and erases power was cut at.
part "power cuts" cargo test -q --workspace --lib --locked -- --nocapture _operation
part "embedding" tests/embedding.sh
part "interchange" tests/interchange.sh
part "link" tests/link.sh
part "microcontrollers" tests/mcu.sh
part "no panic" tests/no-panic.sh
