#!/usr/bin/env bash
# Makes target/mmcp/venv with the protocol's own packages. Does nothing if the folder is up to date.
set -euo pipefail
cd "$(dirname "$0")/../.."

home=target/mmcp
stamp=$home/$(cksum <tests/mmcp/requirements.txt | cut -d' ' -f1).ok
[ -f "$stamp" ] && exit 0
echo "Installing the protocol's packages into $home ..."
rm -rf "$home"
python3 -m venv "$home/venv"
"$home/venv/bin/python" -m pip --disable-pip-version-check install --quiet -r tests/mmcp/requirements.txt
touch "$stamp"
