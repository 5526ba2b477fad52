#!/usr/bin/env bash
# Draws the moving pictures of docs/live.md into a folder, with the server that TROUPE_SERVER names: film-live.sh TROUPE FOLDER
set -euo pipefail
[ $# -eq 2 ] || { echo "usage: film-live.sh TROUPE FOLDER" >&2; exit 2; }
troupe=$1 folder=$2
# Cast, when the picture begins, and how long it is.
while read -r cast from seconds; do
    "$troupe" animate --cast "examples/casts/$cast.toml" --from "$from" --seconds "$seconds" --fps 10 --width 520 --out "$folder/live-$cast.png"
done <<END
turns 2.5 4
aside 1 7
seeds 1 3
END
