#!/usr/bin/env bash
# Checks that dependencies run one way: between crates by `cargo tree`, and between the server's modules by the `crate::` paths
# of each. A module may use those before it in the order below. Tests are free.
set -euo pipefail
cd "$(dirname "$0")/.."

# Bottom up.
order=(telemetry clients offload batch packs records wire world session inbetween service mmcp api health config server doctor)
failed=0

fail() {
    echo "check-layers: $*" >&2
    failed=1
}

# Packages that a crate must not bring along, however far down.
keeps_out() {
    local crate=$1 found
    shift
    found=$(cargo tree --locked --package "$crate" --edges normal --prefix none --format '{p}' |
        cut -d' ' -f1 | sort -u | grep -xE "$(IFS='|' && echo "$*")" | tr '\n' ' ' || true)
    [ -z "$found" ] || fail "$crate depends on $found"
}
keeps_out troupe-motion tokio tonic axum ort prost troupe-proto troupe-engine troupe-character
keeps_out troupe-engine tokio tonic axum troupe-proto troupe-character
keeps_out troupe-character tokio tonic axum ort troupe-engine
keeps_out troupe-client ort troupe-engine troupe-character troupe-server


# The place of a module in the order.
place() {
    local index
    for index in "${!order[@]}"; do
        [ "${order[index]}" != "$1" ] || { echo "$index" && return; }
    done
    echo -1
}

# What a file says without comments and tests.
code() {
    awk '
        /^#\[cfg\(test\)\]$/ { test = 1; next }
        test && /^#/ { next }
        test && /^[^ }].*;$/ { test = 0; next }
        test && /^}$/ { test = 0; next }
        !test { sub(/\/\/.*/, ""); print }
    ' "$1"
}

while read -r file; do
    module=${file#server/src/}
    module=${module%%/*}
    module=${module%.rs}
    mine=$(place "$module")
    [ "$mine" -ge 0 ] || fail "$file: the module $module has no place in the order"
    if code "$file" | grep -q 'crate::{'; then
        fail "$file: each module in a \`use crate::\` of its own, please"
    fi
    for used in $(code "$file" | grep -oE '\bcrate::[a-z_]+' | sed 's/.*:://' | sort -u); do
        [ "$used" != "$module" ] || continue
        theirs=$(place "$used")
        if [ "$theirs" -lt 0 ] || [ "$theirs" -gt "$mine" ]; then
            fail "$file: $module uses $used, which is above it"
        fi
    done
done < <(find server/src -name '*.rs' ! -name '*_tests.rs' ! -name lib.rs ! -name main.rs | sort)

# Model families have names in the engine alone: the crates above go by what a pack can do and says of itself.
families='motion_?bricks|uni_?mo_?gen|ver_?mo\b'
above=()
for folder in character batch live edge server; do
    [ ! -d "$folder/src" ] || above+=("$folder/src")
done
while read -r file; do
    found=$(code "$file" | grep -inE "$families" | head -3 || true)
    [ -z "$found" ] || fail "$file names a model family: $found"
done < <(find "${above[@]}" -name '*.rs' ! -name '*_tests.rs' ! -name tests.rs | sort)

[ "$failed" -ne 0 ] || echo "layers hold: ${order[*]}"
exit "$failed"
