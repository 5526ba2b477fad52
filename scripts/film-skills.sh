#!/usr/bin/env bash
# Draws the pictures of docs/skills.md into a folder, with the server that TROUPE_SERVER names: film-skills.sh TROUPE FOLDER
set -euo pipefail
[ $# -eq 2 ] || { echo "usage: film-skills.sh TROUPE FOLDER" >&2; exit 2; }
troupe=$1 folder=$2
# Path, and the seconds that the strip shows.
while read -r path from to; do
    "$troupe" film --path "examples/paths/g1-$path.toml" --poses 14 --from "$from" --to "$to" --out "$folder/skills-$path.png"
done <<END
crawl 2.0 9.5
jump 0.6 4.4
lie-down 0.4 11.0
END
