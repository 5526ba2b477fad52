#!/usr/bin/env bash
# RUSTC_WORKSPACE_WRAPPER of fuzz.sh: compiles the workspace's own crates with the coverage that libFuzzer is steered by.
rustc=$1
shift
case " $* " in
*" --crate-name build_script_"* | *" proc-macro "*) exec "$rustc" "$@" ;;
esac
exec "$rustc" "$@" -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1
