#!/usr/bin/env bash
# Runs a command with TROUPE_SERVER set to a running server: the one that TROUPE_SERVER names already, or one that this
# script starts on a free port with the packs in models/ and stops when the command is done. TROUPE_BUILD=debug takes the debug build.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -gt 0 ] || { echo "usage: with-server.sh COMMAND [ARGUMENTS]" >&2; exit 2; }
[ -z "${TROUPE_SERVER:-}" ] || exec "$@"

build=${TROUPE_BUILD:-release}
case $build in
debug) scripts/test-server.sh ;;
*) cargo build --profile "$build" --package troupe-server ;;
esac
log=$(mktemp)
ORT_DYLIB_PATH=${ORT_DYLIB_PATH:-$PWD/.runtime/libonnxruntime.so} \
    "target/$build/troupe-server" --listen 127.0.0.1:0 >"$log" 2>&1 &
server=$!
stop() {
    kill "$server" 2>/dev/null || true
    wait "$server" 2>/dev/null || true
    rm -f "$log"
}
trap stop EXIT
for _ in $(seq 600); do
    url=$(sed -n 's|^Troupe serves .* on \(http://[^ ]*\)$|\1|p' "$log")
    [ -z "$url" ] || break
    kill -0 "$server" 2>/dev/null || { cat "$log" >&2; exit 1; }
    sleep 0.1
done
[ -n "$url" ] || { cat "$log" >&2; echo "the server is not ready after a minute" >&2; exit 1; }
TROUPE_SERVER=$url "$@"
