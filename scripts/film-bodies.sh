#!/usr/bin/env bash
# Draws the pictures of docs/unimogen.md, with the server that TROUPE_SERVER names: film-bodies.sh TROUPE FOLDER
# One path, walked by a person, a robot and a horse.
set -euo pipefail
[ $# -eq 2 ] || { echo "usage: film-bodies.sh TROUPE FOLDER" >&2; exit 2; }
troupe=$1 folder=$2 work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for body in human g1 horse; do
    "$troupe" generate --skeleton "$body" --path examples/paths/figure-of-eight.toml --style walk \
        --out "$work/$body.bvh" --picture "$folder/path-$body.png"
done
