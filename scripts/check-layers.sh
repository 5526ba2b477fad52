#!/usr/bin/env bash
# Checks what each crate may bring along, however far down, and that only the engine names model families. Cargo itself refuses
# circles between crates.
set -euo pipefail
cd "$(dirname "$0")/.."

failed=0

fail() {
    echo "check-layers: $*" >&2
    failed=1
}

# Packages that a crate must not bring along.
keeps_out() {
    local crate=$1 tree found
    shift
    tree=$(cargo tree --locked --package "$crate" --edges normal --prefix none --format '{p}')
    found=$(cut -d' ' -f1 <<<"$tree" | sort -u | grep -xE "$(IFS='|' && echo "$*")" | tr '\n' ' ' || true)
    [ -z "$found" ] || fail "$crate depends on $found"
}
keeps_out troupe-motion tokio tonic axum ort prost troupe-proto troupe-engine troupe-character
# Extensions of Python and pages of a browser have the reader alone.
keeps_out troupe-reader-python tokio tonic axum ort prost troupe-proto troupe-engine troupe-character
keeps_out troupe-reader-web tokio tonic axum ort prost troupe-proto troupe-engine troupe-character ufbx
keeps_out troupe-engine tokio tonic axum troupe-proto troupe-character
keeps_out troupe-character tokio tonic axum ort troupe-engine
keeps_out troupe-client ort troupe-engine troupe-character troupe-server
keeps_out troupe-sonic ort troupe-engine troupe-character troupe-server
keeps_out troupe-c ort troupe-engine troupe-character troupe-server
keeps_out troupe-ros2 ort troupe-engine troupe-character troupe-server

keeps_out troupe-base tonic axum ort prost troupe-motion
keeps_out troupe-batch tonic axum prost troupe-character
keeps_out troupe-live tonic axum troupe-edge
keeps_out troupe-service tonic axum troupe-edge
keeps_out troupe-edge tonic ort prost troupe-motion

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

# Model families have names in the engine alone: the crates above go by what a pack can do and says of itself.
families='motion_?bricks|uni_?mo_?gen|ver_?mo\b|sonic_?planner'
while read -r file; do
    found=$(code "$file" | grep -inE "$families" | head -3 || true)
    [ -z "$found" ] || fail "$file names a model family: $found"
done < <(find {character,base,batch,live,edge,service,server}/src -name '*.rs' ! -name '*_tests.rs' ! -name tests.rs | sort)

[ "$failed" -ne 0 ] || echo "layers hold"
exit "$failed"
