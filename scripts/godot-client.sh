#!/usr/bin/env bash
# Checks, tests and builds the Godot client. If there is a Godot 4 (GODOT, `godot`, or that of scripts/get-godot.sh), the extension
# runs in it, against the server of TROUPE_SERVER or one that is started. What a machine lacks is left out, aloud.
set -euo pipefail
cd "$(dirname "$0")/.."

lacks() { echo "*** $1" >&2; }

home=$PWD/target/godot
crate=clients/godot
mkdir -p "$home"
export CARGO_TARGET_DIR=${TROUPE_GODOT_BUILD:-$home/build}

echo "Rust"
python3 clients/conventions/make.py --check
(cd $crate && cargo fmt --check && cargo --quiet clippy --all-targets --locked -- -D warnings && cargo --quiet test --locked && cargo --quiet build --locked)
scripts/tool.sh cargo-deny --manifest-path $crate/Cargo.toml --log-level error --config deny.toml check bans licenses sources

# The engine finds the library's entry by its name.
addon=project/addons/troupe/troupe.gdextension
library=$CARGO_TARGET_DIR/debug/libtroupe_godot.so
entry=$(sed -n 's/^entry_symbol = "\(.*\)"$/\1/p' $crate/$addon)
nm --dynamic --defined-only "$library" | grep " T $entry$" >/dev/null || { echo "$library has no symbol $entry" >&2; exit 1; }
minimum=$(sed -n 's/^compatibility_minimum = //p' $crate/$addon)
grep -q "\"api-${minimum/./-}\"" $crate/Cargo.toml || { echo "$addon and Cargo.toml name other versions of Godot" >&2; exit 1; }

echo "GDScript"
stamp=$home/$(cksum <$crate/tests/requirements.txt | cut -d' ' -f1).ok
if [ ! -f "$stamp" ]; then
    rm -rf "$home/venv" && python3 -m venv "$home/venv"
    "$home/venv/bin/python" -m pip --disable-pip-version-check install --quiet -r $crate/tests/requirements.txt
    touch "$stamp"
fi
"$home/venv/bin/gdformat" --check $crate/project/*.gd $crate/tests/*.gd
"$home/venv/bin/gdlint" $crate/project/*.gd $crate/tests/*.gd

for godot in "${GODOT:-}" "$(command -v godot || true)" "$home/engine/godot"; do [ ! -x "$godot" ] || break; done
if [ ! -x "$godot" ] || [[ $("$godot" --version) != 4.* ]]; then
    lacks "THE EXTENSION WAS NOT RUN IN GODOT: there is no Godot 4 (scripts/get-godot.sh, or GODOT=PATH)"
    exit 0
fi
echo "Godot $("$godot" --version)"
export GODOT=$godot TROUPE_BUILD=${TROUPE_BUILD:-debug}
exec scripts/with-server.sh $crate/tests/engine.sh "$library"
