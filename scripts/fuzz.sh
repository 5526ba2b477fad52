#!/usr/bin/env bash
# Fuzzes one target with libFuzzer, on stable Rust: fuzz.sh TARGET [SECONDS]. See fuzz/README.md.
set -euo pipefail
cd "$(dirname "$0")/.."

target=${1:?"usage: fuzz.sh TARGET [SECONDS]; the targets: $(ls fuzz/corpus | xargs)"}
seconds=${2:-60}
seeds=(fuzz/corpus/"$target")
case $target in
object | scene) seeds+=("examples/${target}s") ;;
esac

# The last build's program is kept apart, so that an ordinary build does not take its place.
RUSTC_WORKSPACE_WRAPPER=$PWD/scripts/fuzz-rustc.sh CARGO_PROFILE_DEV_OPT_LEVEL=1 \
    cargo build --locked --package troupe-fuzz --bin "fuzz-$target"
mkdir -p target/fuzz/corpus/"$target"
cp target/debug/fuzz-"$target" target/fuzz/
exec target/fuzz/fuzz-"$target" -max_total_time="$seconds" -artifact_prefix=target/fuzz/ \
    target/fuzz/corpus/"$target" "${seeds[@]}"
