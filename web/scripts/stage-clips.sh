#!/bin/sh
# Records motions for the stage's demo (stage.html) from a running server, as BVH files: `sh scripts/stage-clips.sh [URL]`.
set -eu
cd "$(dirname "$0")/.."
server=${1:-http://127.0.0.1:8080}
out=src/stage/demo/clips
mkdir -p "$out"
cp ../examples/walk.bvh "$out/"
for body in human g1 horse fox bird spider; do
  troupe --server "$server" generate --pack unimogen --skeleton "$body" --path ../examples/paths/figure-of-eight.toml \
    --seconds 8 --out "$out/$body.bvh"
done
