#!/usr/bin/env bash
# Fuzzes with libFuzzer, on stable Rust. See fuzz/README.md.
#   fuzz.sh TARGET [SECONDS]   one target
#   fuzz.sh all [RUNS]         every target, each so many executions, and a table of what they saw
#   fuzz.sh planted [RUNS]     every target with its planted bug; fails unless each is found in so many executions
set -euo pipefail
cd "$(dirname "$0")/.."

targets=$(ls fuzz/corpus)
what=${1:?"usage: fuzz.sh TARGET [SECONDS], or fuzz.sh all|planted [RUNS]; the targets: $(echo "$targets" | xargs)"}
# Longer inputs make a target slow, and find nothing that shorter ones do not.
limits=(-max_len=4096 -timeout=10 -rss_limit_mb=2048 -print_final_stats=1 -dict=target/fuzz/words)

# The programs of a build are kept apart, so that an ordinary build does not take their place: build FOLDER NAMES [OPTION ...]
build() {
    local folder=$1 names=$2 bins=()
    for name in $names; do bins+=(--bin "fuzz-$name"); done
    RUSTC_WORKSPACE_WRAPPER=$PWD/scripts/fuzz-rustc.sh CARGO_PROFILE_DEV_OPT_LEVEL=1 \
        cargo build --locked --package troupe-fuzz "${bins[@]}" "${@:3}"
    mkdir -p "$folder"
    for name in $names; do cp "target/debug/fuzz-$name" "$folder/"; done
}

# The names of fields, which no fuzzer would guess.
words() {
    mkdir -p target/fuzz
    { sed -n 's/.* \([a-z_0-9]*\) = [0-9]*;.*/"\\"\1\\":"/p' proto/troupe/v1/*.proto
      sed -n 's/^    pub \(r#\)\?\([a-z_0-9]*\):.*/"\2 = "/p' proto/src/docs/*.rs; } | sort -u >target/fuzz/words
}

# The folders that a target starts from.
seeds() {
    echo "fuzz/corpus/$1"
    case $1 in object | scene) echo "examples/${1}s" ;; esac
}

stat() { sed -n "s/^stat::$2: *//p" "$1"; }

words
case $what in
all)
    runs=${2:-1000000}
    build target/fuzz "$targets"
    echo "| target | executions | seconds | edges | features | memory, MiB |"
    echo "|---|---|---|---|---|---|"
    for target in $targets; do
        mkdir -p "target/fuzz/corpus/$target"
        log=target/fuzz/$target.log
        # shellcheck disable=SC2046 # one word a folder
        target/fuzz/fuzz-"$target" "${limits[@]}" -runs="$runs" -artifact_prefix=target/fuzz/ \
            "target/fuzz/corpus/$target" $(seeds "$target") >"$log" 2>&1 || { tail -n 40 "$log" >&2; exit 1; }
        read -r edges features < <(sed -n 's/.*DONE *cov: \([0-9]*\) ft: \([0-9]*\).*/\1 \2/p' "$log")
        seconds=$(sed -n 's/^Done .* in \([0-9]*\) second.*/\1/p' "$log")
        echo "| \`$target\` | $(stat "$log" number_of_executed_units) | $seconds | $edges | $features | $(stat "$log" peak_rss_mb) |"
    done
    ;;
planted)
    runs=${2:-1000000}
    build target/fuzz/planted "$targets" --features planted
    missed=0
    echo "| target | found after |"
    echo "|---|---|"
    for target in $targets; do
        log=target/fuzz/planted/$target.log
        # Nothing is known of earlier runs.
        rm -rf "target/fuzz/planted/corpus" && mkdir "target/fuzz/planted/corpus"
        # shellcheck disable=SC2046 # one word a folder
        target/fuzz/planted/fuzz-"$target" "${limits[@]}" -runs="$runs" -artifact_prefix=target/fuzz/planted/ \
            target/fuzz/planted/corpus $(seeds "$target") >"$log" 2>&1 </dev/null || true
        if grep -q "a planted bug" "$log"; then
            echo "| \`$target\` | $(stat "$log" number_of_executed_units) |"
        else
            echo "| \`$target\` | not in $runs |"
            missed=1
        fi
    done
    exit "$missed"
    ;;
*)
    build target/fuzz "$what"
    mkdir -p "target/fuzz/corpus/$what"
    # shellcheck disable=SC2046 # one word a folder
    exec target/fuzz/fuzz-"$what" "${limits[@]}" -max_total_time="${2:-60}" -artifact_prefix=target/fuzz/ \
        "target/fuzz/corpus/$what" $(seeds "$what")
    ;;
esac
