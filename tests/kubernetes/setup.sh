#!/usr/bin/env bash
# Makes target/kubernetes/venv for the tests of deploy/kubernetes and deploy/cluster. Does nothing if the folder is up to date.
set -euo pipefail
cd "$(dirname "$0")/../.."

home=target/kubernetes
stamp=$home/$(cat tests/kubernetes/requirements.txt tests/kubernetes/setup.sh | cksum | cut -d' ' -f1).ok
[ -f "$stamp" ] && exit 0
rm -rf "$home"
python3 -m venv "$home/venv"
pip=("$home/venv/bin/python" -m pip --disable-pip-version-check)
"${pip[@]}" install --quiet -r tests/kubernetes/requirements.txt
# Only for compose_spec.json: its program, Compose 1, is not run.
"${pip[@]}" install --quiet --no-deps docker-compose==1.29.2
touch "$stamp"
