#!/usr/bin/env bash
# Copies examples/scenes and examples/objects into a folder, laid out as the server's options --scenes and --objects want them:
# FOLDER/scenes and FOLDER/objects/PACK. A copy, because the server writes uploads there and removes what is deleted.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# = 1 ] || { echo "usage: example-folders.sh FOLDER" >&2; exit 2; }

mkdir -p "$1/scenes" "$1/objects/human"
cp examples/scenes/*.toml "$1/scenes/"
cp examples/objects/*.toml "$1/objects/human/"
