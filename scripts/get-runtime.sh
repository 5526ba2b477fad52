#!/usr/bin/env bash
# Puts ONNX Runtime at .runtime/libonnxruntime.so, out of the wheel pinned in onnxruntime-KIND.txt. KIND is openvino on
# CPUs that compute in bf16, where OpenVINO is nearly twice as fast, and cpu elsewhere; TROUPE_RUNTIME=cpu|openvino|gpu decides
# otherwise. gpu has ONNX Runtime's providers for CUDA and TensorRT, and beside them the parts of CUDA 13 and cuDNN 9 that they need:
# 0.6 GB to fetch, 1.4 GB on the disk. NVIDIA's driver must come from the system, and so must TensorRT.
# The wheels are only containers here: nothing of Python's is used at run time.
set -euo pipefail
cd "$(dirname "$0")/.."

system=$(uname -s)-$(uname -m)
kind=${TROUPE_RUNTIME:-}
if [ -z "$kind" ]; then
    kind=cpu
    if [ "$system" = Linux-x86_64 ] && grep -qE '^flags.* (avx512_bf16|amx_bf16)( |$)' /proc/cpuinfo; then
        kind=openvino
    fi
fi
case "$kind-$system" in
*-Linux-x86_64) platform=manylinux_2_28_x86_64 ;;
cpu-Linux-aarch64) platform=manylinux_2_28_aarch64 ;;
cpu-Darwin-arm64) platform=macosx_14_0_arm64 ;;
openvino-* | gpu-*)
    echo "The wheel for TROUPE_RUNTIME=$kind is for Linux x86-64 only; this is $system. TROUPE_RUNTIME=cpu works." >&2
    exit 1
    ;;
*)
    echo "No ONNX Runtime wheel is pinned for $system." >&2
    echo "Set ORT_DYLIB_PATH to an ONNX Runtime library of version 1.24 or newer." >&2
    exit 1
    ;;
esac
pin=scripts/onnxruntime-$kind.txt
[ -f "$pin" ] || { echo "TROUPE_RUNTIME is $kind; allowed: cpu, openvino, gpu" >&2; exit 1; }

# One folder for each wheel; the link names the one in use. ONNX Runtime looks for its providers beside its own file,
# under the names that they have in the wheel.
folder=$kind-$(cksum <"$pin" | cut -d' ' -f1)
use() {
    local library
    library=$(cd .runtime && find "$folder" -name 'libonnxruntime.*' | head -n 1)
    [ "$(readlink .runtime/libonnxruntime.so 2>/dev/null)" = "$library" ] || {
        ln -sfn "$library" .runtime/libonnxruntime.so
        echo "ONNX Runtime in use: .runtime/$library"
    }
}
# A folder of an older version of this script lacks a library.
complete=.runtime/$folder/.complete-2
if [ -f "$complete" ]; then
    use
    exit 0
fi

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
platforms=(--platform "$platform")
# NVIDIA's wheels are for older systems, too, and say so.
[ "$kind" != gpu ] || platforms+=(--platform manylinux_2_27_x86_64 --platform manylinux2014_x86_64)
echo "Fetching ONNX Runtime ($kind, $platform) ..."
"${pip[@]}" download --quiet --no-deps --require-hashes --only-binary=:all: --python-version 3.12 \
    --implementation cp --abi cp312 --abi none "${platforms[@]}" --dest "$work" -r "$pin"
for wheel in "$work"/*.whl; do
    python3 -m zipfile -e "$wheel" "$work/wheel"
    rm "$wheel"
done

# The libraries alone, each once: of those of OpenVINO that come under several names, the one that others link to. Its
# plugins for GPUs, NPUs and several devices at once are not used here.
rm -rf ".runtime/$folder"
mkdir ".runtime/$folder"
find "$work/wheel/onnxruntime/capi" -maxdepth 1 \( -name 'lib*.so*' -o -name 'lib*.dylib' \) \
    ! -name 'libopenvino*.so.20*' ! -name 'libopenvino.so' ! -name 'libopenvino_onnx_frontend.so' ! -name 'libtbb.so' \
    ! -name 'libopenvino_c.so' ! -name 'libopenvino_*_gpu_plugin.so' ! -name 'libopenvino_*_npu_plugin.so' \
    ! -name 'libopenvino_auto_plugin.so' ! -name 'libopenvino_hetero_plugin.so' \
    -exec mv {} ".runtime/$folder/" \;
# CUDA's libraries find each other in one folder, and the server finds them beside ONNX Runtime's.
[ ! -d "$work/wheel/nvidia" ] || find "$work/wheel/nvidia" -name 'lib*.so.*' ! -name 'libnvblas*' -exec mv {} ".runtime/$folder/" \;
# Who hands the libraries on, in an image say, hands on their licences too.
for terms in "$work"/wheel/nvidia_*.dist-info/licenses/License.txt; do
    [ ! -f "$terms" ] || cp "$terms" ".runtime/$folder/LICENSE-$(basename "${terms%-*.dist-info/*}")"
done
cp "$work/wheel/onnxruntime/LICENSE" "$work/wheel/onnxruntime/ThirdPartyNotices.txt" ".runtime/$folder/"
touch "$complete"
use
