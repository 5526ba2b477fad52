#!/usr/bin/env bash
# Puts the ONNX Runtime library at .runtime/libonnxruntime.so, out of the wheel pinned in onnxruntime.txt.
# The wheel is only a container here: nothing of Python's is used at run time.
set -euo pipefail
cd "$(dirname "$0")/.."

stamp=.runtime/$(cksum <scripts/onnxruntime.txt | cut -d' ' -f1).ok
[ -f "$stamp" ] && [ -f .runtime/libonnxruntime.so ] && exit 0

case "$(uname -s)-$(uname -m)" in
Linux-x86_64) platform=manylinux_2_28_x86_64 ;;
Linux-aarch64) platform=manylinux_2_28_aarch64 ;;
Darwin-arm64) platform=macosx_14_0_arm64 ;;
*)
    echo "No ONNX Runtime wheel is pinned for $(uname -s) $(uname -m)." >&2
    echo "Set ORT_DYLIB_PATH to an ONNX Runtime library of version 1.24 or newer." >&2
    exit 1
    ;;
esac

pip=(python3 -m pip)
if ! "${pip[@]}" --version >/dev/null 2>&1; then
    python3 -m venv .runtime/venv || {
        echo "Python 3 with pip or venv is needed (Debian: apt-get install python3-venv)." >&2
        exit 1
    }
    pip=(.runtime/venv/bin/python -m pip)
fi

mkdir -p .runtime
work=$(mktemp -d .runtime/download.XXXXXX)
trap 'rm -rf "$work"' EXIT
echo "Fetching ONNX Runtime ($platform) ..."
"${pip[@]}" download --quiet --no-deps --require-hashes --only-binary=:all: --python-version 3.12 \
    --implementation cp --abi cp312 --platform "$platform" --dest "$work" -r scripts/onnxruntime.txt
python3 -m zipfile -e "$work"/*.whl "$work/wheel"
library=$(find "$work/wheel/onnxruntime/capi" -name 'libonnxruntime.*' ! -name '*providers*' | head -n 1)
mv "$library" .runtime/libonnxruntime.so
touch "$stamp"
