#!/usr/bin/env bash
# Makes target/ros2/venv with another DDS than the node's. Does nothing if the folder is up to date.
set -euo pipefail
cd "$(dirname "$0")/../.."

home=target/ros2
stamp=$home/$(cksum <tests/ros2/requirements.txt | cut -d' ' -f1).ok
[ -f "$stamp" ] && exit 0
echo "Installing Cyclone DDS into $home ..."
rm -rf "$home"
python3 -m venv "$home/venv"
"$home/venv/bin/python" -m pip --disable-pip-version-check install --quiet -r tests/ros2/requirements.txt
touch "$stamp"
