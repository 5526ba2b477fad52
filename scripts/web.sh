#!/usr/bin/env bash
# The viewer in web/: `check` lints and tests its sources, `build` makes web/dist and checks that the committed one is the same
# (WEB_DIST=any: does not compare), `e2e` runs the browser tests against a built troupe-server, `pictures` makes the pictures of
# docs/pictures, `measure` prints what a crowd costs a browser.
# It installs what it needs: the npm packages of the lock file, and Debian's Chromium if it has apt and root.
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

case ${1:-} in
check)
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
    die "usage: scripts/web.sh check | build | e2e | pictures | measure [PLAYWRIGHT'S ARGUMENTS]"
    ;;
esac
