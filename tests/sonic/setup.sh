#!/usr/bin/env bash
# Makes target/sonic/venv with ZeroMQ as robots have it. Does nothing if the folder is up to date.
set -euo pipefail
cd "$(dirname "$0")/../.."

home=target/sonic
stamp=$home/$(cksum <tests/sonic/requirements.txt | cut -d' ' -f1).ok
[ -f "$stamp" ] && exit 0
echo "Installing ZeroMQ's packages into $home ..."
rm -rf "$home"
python3 -m venv "$home/venv"
"$home/venv/bin/python" -m pip --disable-pip-version-check install --quiet -r tests/sonic/requirements.txt
touch "$stamp"
