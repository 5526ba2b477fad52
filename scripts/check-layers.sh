#!/usr/bin/env bash
# Checks what each crate may bring along, however far down. Cargo itself refuses circles between crates.
set -euo pipefail
cd "$(dirname "$0")/.."

failed=0

# Packages that a crate must not bring along.
keeps_out() {
    local crate=$1 found
    shift
    found=$(cargo tree --locked --package "$crate" --edges normal --prefix none --format '{p}' |
        cut -d' ' -f1 | sort -u | grep -xE "$(IFS='|' && echo "$*")" | tr '\n' ' ' || true)
    if [ -n "$found" ]; then
        echo "check-layers: $crate depends on $found" >&2
        failed=1
    fi
}
keeps_out troupe-motion tokio tonic axum ort prost troupe-proto troupe-engine troupe-character
keeps_out troupe-engine tokio tonic axum troupe-proto troupe-character
keeps_out troupe-character tokio tonic axum ort troupe-engine
keeps_out troupe-client ort troupe-engine troupe-character troupe-server

keeps_out troupe-base tonic axum ort prost troupe-motion
keeps_out troupe-batch tonic axum prost troupe-character
keeps_out troupe-live tonic axum troupe-edge
keeps_out troupe-edge tonic ort prost troupe-motion

[ "$failed" -ne 0 ] || echo "layers hold"
exit "$failed"
