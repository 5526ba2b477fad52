#!/usr/bin/env bash
# Makes .venv with the training package and its development tools. Does nothing where it is up to date.
set -euo pipefail
cd "$(dirname "$0")/.."

stamp=.venv/$(cat training/pyproject.toml scripts/tools.txt | cksum | cut -d' ' -f1).ok
[ -f "$stamp" ] && exit 0
echo "Installing the training package into .venv (PyTorch is large) ..."
python3 -m venv .venv
.venv/bin/python -m pip install --quiet -e 'training[dev]' -r scripts/tools.txt
touch "$stamp"
