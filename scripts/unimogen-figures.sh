#!/usr/bin/env bash
# Measures models/unimogen on held-out clips and writes its card: unimogen-figures.sh [FOLDER]
# FOLDER (runs/figures) gets a JSON file from each command. What is there is kept, so the same call goes on after a stop; empty it to
# measure again. `troupe-train unimogen prepare` makes the cache. About 30 minutes on one quiet core.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=${1:-runs/figures}
mkdir -p "$folder"

measure() { # NAME COMMAND OPTIONS...
    local name=$1
    shift
    [ -s "$folder/$name.json" ] && return
    .venv/bin/troupe-train unimogen "$@" --pack models/unimogen --threads 1 --json "$folder/$name.json"
}

for body in human g1 h1 h1_2; do
    measure "$body" evaluate --trained-bodies "$body" --max-windows 0
done
few=(--parts test --max-windows 96)
measure steps-human evaluate --trained-bodies human "${few[@]}" --other-steps 1 2 8 50
measure guidance-human evaluate --trained-bodies human "${few[@]}" --other-guidance 2 3 4
measure steps-g1 evaluate --trained-bodies g1 "${few[@]}" --other-steps 1 2 8 50
measure guidance-g1 evaluate --trained-bodies g1 "${few[@]}" --other-guidance 2 3 4
measure paths paths
measure blend blend --styles masculine feminine --parts test
measure blend-guided blend --styles masculine feminine --parts test --guidance 2.5

.venv/bin/troupe-train unimogen card --pack models/unimogen --notes training/cards/unimogen.md \
    --evaluations "$folder"/{human,g1,h1,h1_2}.json \
    --sweeps "$folder"/{steps-human,guidance-human,steps-g1,guidance-g1}.json \
    --user-paths "$folder/paths.json" \
    --blend "$folder"/{blend,blend-guided}.json
