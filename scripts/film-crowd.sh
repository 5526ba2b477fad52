#!/usr/bin/env bash
# Draws the moving picture of README.md, with the server that TROUPE_SERVER names: film-crowd.sh TROUPE FILE
# It puts the stool and the square of the cast on that server before.
set -euo pipefail
[ $# -eq 2 ] || { echo "usage: film-crowd.sh TROUPE FILE" >&2; exit 2; }
troupe=$1 file=$2
"$troupe" object put examples/objects/seat.toml
"$troupe" scene put examples/scenes/plaza.toml
"$troupe" film --cast examples/casts/plaza.toml --width 880 --out "$file"
