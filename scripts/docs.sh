#!/usr/bin/env bash
# Builds the site of docs/ into target/site, for the server to serve at /docs/. A broken link or a missing anchor is an error.
# --references writes docs/references anew. --check only says whether those are current, and builds the site.
set -euo pipefail
cd "$(dirname "$0")/.."

home=target/docs-venv
stamp=$home/$(cksum <docs/requirements.txt | cut -d' ' -f1).ok
if [ ! -f "$stamp" ]; then
    python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Python 3.11 or newer is needed" >&2; exit 1; }
    rm -rf "$home"
    python3 -m venv "$home"
    "$home/bin/python" -m pip --disable-pip-version-check install --quiet -r docs/requirements.txt
    touch "$stamp"
fi
case "${1:-}" in
--references) exec "$home/bin/python" docs/site/references.py ;;
--check) "$home/bin/python" docs/site/references.py --check ;;
"") ;;
*) echo "usage: docs.sh [--references | --check]" >&2; exit 2 ;;
esac
"$home/bin/python" docs/site/stage.py target/docs
(cd target/docs && "../../$home/bin/zensical" build --strict)
[ -f target/docs/site/index.html ] || { echo "docs.sh: zensical has built no site" >&2; exit 1; }
"$home/bin/python" docs/site/finish.py target/docs/site
rm -rf target/site
mv target/docs/site target/site
