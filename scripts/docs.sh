#!/usr/bin/env bash
# The site of docs/, which the server serves at /docs:
#   build [DIR]  builds it into target/site, which the server shows, or into DIR. A link to nothing is an error.
#   check        the same, and docs/references must be what their sources say
#   references   writes docs/references
# Python packages are installed into target/docs-venv: those of docs/site/requirements.txt, and of docs/site/references.txt for the last two.
set -euo pipefail
cd "$(dirname "$0")/.."

usage() {
    echo "usage: scripts/docs.sh build [DIR] | check | references" >&2
    exit 2
}

home=target/docs-venv
# Installs the packages of a list, unless they are there.
packages() {
    local stamp
    stamp=$home/$(cksum <"$1" | cut -d' ' -f1).ok
    [ ! -f "$stamp" ] || return 0
    python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "docs.sh: Python 3.11 or newer is needed" >&2; exit 1; }
    [ -x "$home/bin/python" ] || python3 -m venv "$home"
    "$home/bin/python" -m pip --disable-pip-version-check install --quiet -r "$1"
    touch "$stamp"
}

references() {
    packages docs/site/references.txt
    "$home/bin/python" docs/site/references.py "$@"
}

build() {
    local out=${1:-target/site} made=target/docs/site
    packages docs/site/requirements.txt
    "$home/bin/python" docs/site/stage.py target/docs
    (cd target/docs && "../../$home/bin/zensical" build --strict)
    [ -f "$made/index.html" ] || { echo "docs.sh: zensical has built no site" >&2; exit 1; }
    "$home/bin/python" docs/site/finish.py "$made"
    # A server that runs never sees half a site.
    rm -rf "$out.new" "$out.old"
    mkdir -p "$out"
    cp -R "$made" "$out.new"
    mv "$out" "$out.old"
    mv "$out.new" "$out"
    rm -rf "$out.old"
}

[ $# -gt 0 ] || usage
command=$1
shift
case $command in
build) build "$@" ;;
check) references --check && build ;;
references) references ;;
*) usage ;;
esac
