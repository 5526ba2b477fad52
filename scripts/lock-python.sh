#!/usr/bin/env bash
# Writes scripts/python-lock.txt: every package of the Python environment with its version and hashes, for any platform. What is
# locked stays as it is where it fits; `scripts/lock-python.sh --upgrade` takes the newest of everything.
set -euo pipefail
cd "$(dirname "$0")/.."

home=target/uv
[ -x "$home/bin/uv" ] || { python3 -m venv "$home" && "$home/bin/python" -m pip install --quiet uv==0.13.9; }
# No index is named: the lock fits any that mirrors PyPI.
"$home/bin/uv" pip compile --quiet --no-config --universal --python-version 3.11 --generate-hashes --no-emit-index-url \
    --no-annotate --custom-compile-command "make python-lock" --extra dev \
    --output-file scripts/python-lock.txt "$@" training/pyproject.toml scripts/tools.txt
