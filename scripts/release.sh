#!/usr/bin/env bash
# Makes a release archive in target/release-archives: the programs, ONNX Runtime, the packs, the examples, an SBOM and checksums.
# install.sh unpacks it. TROUPE_RUNTIME=cpu, openvino or gpu chooses the library (default: cpu, which runs on every CPU).
# The profile `dist` is the slow, optimised build. PROFILE=release takes the quick one.
set -euo pipefail
cd "$(dirname "$0")/.."

profile=${PROFILE:-dist}
export TROUPE_RUNTIME=${TROUPE_RUNTIME:-cpu}
version=$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"$/\1/p' Cargo.toml)
platform=$(uname -s | tr '[:upper:]' '[:lower:]')-$(uname -m)
name=troupe-$version-$platform-$TROUPE_RUNTIME
out=target/release-archives
tree=$out/$name

# The SBOM lists every crate of the server's binary (CycloneDX). The tool is built once, into target/.
sbom() {
    local tool=target/tools/bin/cargo-cyclonedx
    [ -x "$tool" ] || cargo install --quiet --locked --root target/tools --version 0.5.9 cargo-cyclonedx
    "$tool" cyclonedx --quiet --manifest-path server/Cargo.toml --format json --override-filename "$name.cdx"
    mv "server/$name.cdx.json" "$tree/sbom.cdx.json"
    find . -path ./target -prune -o -name "$name.cdx.json" -exec rm {} +
}

rm -rf "$tree"
mkdir -p "$tree/bin" "$tree/lib"
scripts/get-runtime.sh
scripts/docs.sh build "$tree/docs"
cargo build --locked --profile "$profile" --package troupe-server --package troupe-cli --package troupe-loadtest \
    --features troupe-server/jemalloc
for program in troupe-server troupe troupe-loadtest; do
    install -s "target/$profile/$program" "$tree/lib/$program"
done
library=$(readlink -f .runtime/libonnxruntime.so)
cp "$(dirname "$library")"/* "$tree/lib/"
ln -sf "$(basename "$library")" "$tree/lib/libonnxruntime.so"
cp -R models examples LICENSE NOTICE README.md "$tree/"
find "$tree" -name __pycache__ -prune -exec rm -r {} +
sbom

# Starts a program with the library and the packs of its own archive, unless the environment names others.
cat >"$tree/bin/troupe-server" <<'PROGRAM'
#!/bin/sh
home=$(dirname "$(dirname "$(readlink -f "$0")")")
export ORT_DYLIB_PATH="${ORT_DYLIB_PATH:-$home/lib/libonnxruntime.so}"
export TROUPE_PACKS="${TROUPE_PACKS:-$home/models}" TROUPE_DOCS="${TROUPE_DOCS:-$home/docs}"
exec "$home/lib/troupe-server" "$@"
PROGRAM
chmod +x "$tree/bin/troupe-server"
for program in troupe troupe-loadtest; do
    ln -s "../lib/$program" "$tree/bin/$program"
done

tar -C "$out" --owner=0 --group=0 --sort=name -czf "$out/$name.tar.gz" "$name"
cp install.sh "$out/"
(cd "$out" && sha256sum "$name.tar.gz" install.sh >"$name.sha256")
rm -rf "$tree"
ls -l "$out"
