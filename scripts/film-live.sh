#!/usr/bin/env bash
# Draws the moving pictures of docs/live.md into a folder, with the server that TROUPE_SERVER names: film-live.sh TROUPE FOLDER
set -euo pipefail
[ $# -eq 2 ] || { echo "usage: film-live.sh TROUPE FOLDER" >&2; exit 2; }
troupe=$1 folder=$2
# Cast, and the seconds that the picture shows.
while read -r cast from to; do
    "$troupe" film --cast "examples/casts/$cast.toml" --from "$from" --to "$to" --fps 10 --width 520 --out "$folder/live-$cast.png"
done <<END
turns 2.5 6.5
aside 1 8
seeds 1 4
END
