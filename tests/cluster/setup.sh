#!/usr/bin/env bash
# Makes target/cluster/venv for the tests of several servers. Does nothing if the folder is up to date.
set -euo pipefail
cd "$(dirname "$0")/../.."

home=target/cluster
stamp=$home/$(cksum <tests/cluster/requirements.txt | cut -d' ' -f1).ok
[ -f "$stamp" ] && exit 0
echo "Installing the other side of a cluster into $home ..."
rm -rf "$home"
python3 -m venv "$home/venv"
"$home/venv/bin/python" -m pip --disable-pip-version-check install --quiet -r tests/cluster/requirements.txt
touch "$stamp"
