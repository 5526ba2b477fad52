#!/usr/bin/env bash
# Draws the pictures of docs/objects.md into a folder, with the server that TROUPE_SERVER names: film-objects.sh TROUPE FOLDER
# It puts the objects and the courtyard of the examples on that server, again before each picture: a cup that was carried lies
# elsewhere.
set -euo pipefail
[ $# -eq 2 ] || { echo "usage: film-objects.sh TROUPE FOLDER" >&2; exit 2; }
troupe=$1 folder=$2
"$troupe" object put examples/objects/*.toml
# Path, and the seconds that the strip shows.
while read -r path from to; do
    "$troupe" scene put examples/scenes/courtyard.toml
    "$troupe" film --path "examples/paths/$path.toml" --poses 12 --from "$from" --to "$to" --out "$folder/objects-$path.png"
done <<END
bow 1.8 7.3
sit 2.7 11.5
cup 2.0 7.0
END
