#!/bin/sh
# Writes the types of the server's messages: the stream's from proto/, those over HTTP from server/openapi.json.
set -eu
cd "$(dirname "$0")/.."
npx buf generate
# It needs a compiler of its own, older than the viewer's.
npx --yes --package openapi-typescript@7.13.0 --package typescript@5.9.3 \
    openapi-typescript ../server/openapi.json --output src/wire/gen/openapi.ts
