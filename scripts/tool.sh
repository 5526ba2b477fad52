#!/usr/bin/env bash
# Runs a tool of tools.txt: tool.sh NAME ARGUMENTS. If the tool is not installed, it says so loudly; in CI that is a failure.
set -euo pipefail
cd "$(dirname "$0")/.."

name=$1
shift
PATH="$PWD/.venv/bin:$PATH"
if command -v "$name" >/dev/null; then
    exec "$name" "$@"
fi
echo "*** $name WAS NOT RUN: it is not installed, and scripts/tools.txt has no wheel of it for $(uname -s)-$(uname -m)." >&2
if [ "${CI:-}" = true ]; then exit 1; fi
