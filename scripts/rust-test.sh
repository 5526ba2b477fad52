#!/usr/bin/env bash
# Runs the Rust tests with cargo-nextest, or with cargo test where that is not installed, then the doc tests. The arguments
# go to cargo.
set -euo pipefail
cd "$(dirname "$0")/.."

PATH="$PWD/.venv/bin:$PATH"
if command -v cargo-nextest >/dev/null; then
    cargo nextest run "$@"
else
    echo "*** cargo-nextest is not installed: the tests run with cargo test, and those that measure time may disturb each other." >&2
    cargo test --lib --bins --tests "$@"
fi
cargo test --doc "$@"
