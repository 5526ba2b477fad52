#!/usr/bin/env bash
# Builds target/debug/troupe-server with the features that the Rust tests build it with. `cargo build --package troupe-server` would
# compile it and its dependencies once more, because the tests need further features of tokio and others.
set -euo pipefail
cd "$(dirname "$0")/.."
exec cargo test --quiet --workspace --locked --no-run --test packs
