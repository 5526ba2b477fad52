#!/usr/bin/env bash
# Draws the moving picture of docs/words.md, with the server that TROUPE_SERVER names: film-words.sh TROUPE FILE
set -euo pipefail
[ $# -eq 2 ] || { echo "usage: film-words.sh TROUPE FILE" >&2; exit 2; }
troupe=$1 file=$2
"$troupe" film --cast examples/casts/words.toml --from 0.6 --to 5.6 --width 880 --out "$file"
