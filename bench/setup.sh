#!/usr/bin/env bash
# Makes target/bench/venv with the Python servers, and target/bench/ort-ENGINE with the ONNX Runtime of each engine: the
# library in it is what the server and the raw loop load too. Does nothing where all is up to date.
set -euo pipefail
cd "$(dirname "$0")/.."

home=target/bench
stamp=$home/$(cat bench/requirements.txt bench/setup.sh | cksum | cut -d' ' -f1).ok
[ -f "$stamp" ] && exit 0
echo "Installing the Python servers into $home ..."
mkdir -p "$home"
rm -rf "$home"/venv "$home"/ort-* "$home"/*.ok
python3 -m venv "$home/venv"
pip=("$home/venv/bin/python" -m pip --disable-pip-version-check install --quiet)
"${pip[@]}" -r bench/requirements.txt
"${pip[@]}" --no-deps --target "$home/ort-cpu" onnxruntime==1.31.1
# openvino, of the version that is in the other, counts the time of its operators.
"${pip[@]}" --no-deps --target "$home/ort-openvino" onnxruntime-openvino==1.24.1 openvino==2025.4.1 ||
    echo "onnxruntime-openvino is not to be had here: the OpenVINO rows are left out." >&2
touch "$stamp"
