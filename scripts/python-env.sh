#!/usr/bin/env bash
# Makes .venv with the training package and its development tools, as scripts/python-lock.txt pins them by hash, and with the
# reader of motion files (bindings/python), which Rust builds. Does nothing if it is up to date. `make python-lock` renews the lock.
#
# On Linux the PyTorch of PyPI brings CUDA, 5 GB of it. TROUPE_TORCH_INDEX=https://download.pytorch.org/whl/cpu takes the locked
# version from that index instead, without CUDA. The lock has no hashes of that build, so it is pinned by its version alone.
set -euo pipefail
cd "$(dirname "$0")/.."

lock=scripts/python-lock.txt
pip=(.venv/bin/python -m pip --disable-pip-version-check)

# The reader is built again after a change of its sources, as a wheel, which scripts/python-client.sh takes too. maturin is found
# by PATH alone. In CI the tests' profile builds it: that is quicker, and what they read is small.
reader() {
    local sources stamp
    sources=$(find motion/src motion/Cargo.toml bindings/python Cargo.toml Cargo.lock -type f ! -name '*.pyc' \
        ! -path '*/tests/*' -print0 |
        sort -z | xargs -0 cat | cksum | cut -d' ' -f1)
    stamp=.venv/reader-$sources.ok
    [ -f "$stamp" ] && return
    command -v cargo >/dev/null || { echo "Rust is needed for the reader of motion files: https://rustup.rs" >&2; exit 1; }
    echo "Building the reader of motion files ..."
    rm -rf target/reader
    PATH="$PWD/.venv/bin:$PATH" MATURIN_PEP517_ARGS="${CI:+--profile dev}" \
        "${pip[@]}" wheel --quiet --no-deps --no-build-isolation --wheel-dir target/reader ./bindings/python
    "${pip[@]}" install --quiet --no-deps --force-reinstall target/reader/*.whl
    rm -f .venv/reader-*.ok
    touch "$stamp"
}

stamp=.venv/$(cat training/pyproject.toml "$lock" | cksum | cut -d' ' -f1).ok
if [ -f "$stamp" ]; then
    reader
    exit 0
fi
python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Python 3.11 or newer is needed" >&2; exit 1; }
echo "Installing the training package into .venv (PyTorch is large) ..."
python3 -m venv .venv
if [ -n "${TROUPE_TORCH_INDEX:-}" ]; then
    torch=$(sed -n 's/^\(torch==[^ ]*\).*/\1/p' "$lock")
    "${pip[@]}" install --quiet --no-deps --index-url "$TROUPE_TORCH_INDEX" "$torch"
    # The rest: a package is a line that begins with its name, and the lines of its hashes.
    rest=$(mktemp)
    trap 'rm -f "$rest"' EXIT
    awk '/^[a-z]/ { skip = /^(torch|triton|cuda-|nvidia-)/ } !skip' "$lock" >"$rest"
    lock=$rest
fi
"${pip[@]}" install --quiet --require-hashes -r "$lock"
"${pip[@]}" install --quiet --no-deps --no-build-isolation -e training
reader
"${pip[@]}" check >/dev/null || { "${pip[@]}" check; echo "make python-lock renews the lock" >&2; exit 1; }
touch "$stamp"
