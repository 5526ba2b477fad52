#!/usr/bin/env bash
# The viewer in web/: `check` lints and tests its sources, `build` makes web/dist and checks that the committed one is the same
# (WEB_DIST=any: does not compare), `e2e` runs the browser tests against a built troupe-server, `pictures` makes the pictures of
# docs/pictures, `measure` prints what a crowd costs a browser. `reader` builds the reader of motion files and the retargeter as
# WebAssembly (bindings/web) into web/src/reader, which is committed: all else needs no Rust. It is due after a change of its sources.
# It installs what it needs: the npm packages of the lock file, and Debian's Chromium if it has apt and root; for `reader` the
# command wasm-bindgen, and rustup's target wasm32-unknown-unknown.
set -euo pipefail
cd "$(dirname "$0")/.."

die() {
    echo "web.sh: $*" >&2
    exit 1
}

# Installs the packages of the lock file, unless those that are there came from it.
packages() {
    command -v npm >/dev/null || die "npm is missing (Node 20.19 or newer)"
    local stamp=web/node_modules/.of-lock
    if ! cmp -s web/package-lock.json "$stamp"; then
        PLAYWRIGHT_SKIP_BROWSER_DOWNLOAD=1 npm --prefix web ci
        cp web/package-lock.json "$stamp"
    fi
}

browser() {
    CHROMIUM=$(command -v "${CHROMIUM:-chromium}" || command -v chromium-browser || true)
    if [ -z "$CHROMIUM" ]; then
        [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null || die "chromium is missing: install it, or name one in CHROMIUM"
        apt-get update -qq
        apt-get install -y -qq --no-install-recommends chromium fonts-liberation
        CHROMIUM=$(command -v chromium)
    fi
    export CHROMIUM
}

# What the WebAssembly is built of, as one number. Tests are not in it.
reader_sources() {
    find bindings/web motion/Cargo.toml motion/src/{read,anatomy,bvh,glb,files,convert,robot,retarget,ik} \
        motion/src/{clip,skeleton,fk,root,rotation,interpolate}.rs -type f \
        ! -path '*/tests/*' ! -name 'test*.rs' | LC_ALL=C sort | xargs cat | cksum | cut -d' ' -f1
}

case ${1:-} in
reader)
    version=$(sed -n 's/^wasm-bindgen = "=\(.*\)"$/\1/p' bindings/web/Cargo.toml)
    tool=target/tools/bin/wasm-bindgen
    [ "$("$tool" --version 2>/dev/null)" = "wasm-bindgen $version" ] ||
        cargo install --quiet --root target/tools --version "$version" --bin wasm-bindgen wasm-bindgen-cli
    rustup target add wasm32-unknown-unknown
    # The same bytes wherever it is built.
    RUSTFLAGS="--remap-path-prefix=$PWD=. --remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=cargo" cargo build --locked \
        --profile wasm --target wasm32-unknown-unknown --package troupe-reader-web
    "$tool" --target web --remove-name-section --remove-producers-section --out-dir web/src/reader \
        "${CARGO_TARGET_DIR:-target}/wasm32-unknown-unknown/wasm/troupe_reader_web.wasm"
    reader_sources >web/src/reader/sources
    ;;
check)
    [ "$(reader_sources)" = "$(cat web/src/reader/sources)" ] || die "the reader has changed: run scripts/web.sh reader"
    packages
    npm --prefix web run check
    npm --prefix web test
    ;;
build)
    packages
    npm --prefix web run build
    if [ "${WEB_DIST:-}" != any ]; then
        [ -n "$(git ls-files web/dist)" ] || die "web/dist is not committed"
        [ -z "$(git status --porcelain -- web/dist)" ] ||
            { git --no-pager diff --stat -- web/dist; die "web/dist is not what its sources build: commit it"; }
    fi
    ;;
e2e | pictures | measure)
    packages
    browser
    # The runner of the browser tests finds the server by TROUPE_SERVER, or in target/.
    cd web && npm run "$1" -- "${@:2}"
    ;;
*)
    die "usage: scripts/web.sh reader | check | build | e2e | pictures | measure [PLAYWRIGHT'S ARGUMENTS]"
    ;;
esac
