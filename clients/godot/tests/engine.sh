#!/usr/bin/env bash
# Runs the example with the extension in Godot: engine.sh LIBRARY, with GODOT and TROUPE_SERVER set. A second server has TLS and keys,
# and a connection through a forwarder breaks.
set -euo pipefail
cd "$(dirname "$0")/../../.."

library=$1
home=$PWD/target/godot
project=$home/project
rm -rf "$project"
cp -r clients/godot/project "$project"
cp clients/godot/tests/engine.gd "$project/"
sed -n '/^```gdscript$/,/^```$/{/^```/!p}' docs/tutorials/godot.md >"$project/tutorial.gd"
mkdir -p "$project/addons/troupe/bin"
cp "$library" "$project/addons/troupe/bin/"
# What Godot keeps of its user.
export XDG_CONFIG_HOME=$home/user XDG_DATA_HOME=$home/user XDG_CACHE_HOME=$home/user

started=()
stop() { kill "${started[@]}" 2>/dev/null || true; }
trap stop EXIT

coproc FORWARDER { exec python3 clients/c/tests/forwarder.py "${TROUPE_SERVER#*://}"; }
started+=("$FORWARDER_PID")
read -r port <&"${FORWARDER[0]}"
export TROUPE_FORWARDER=http://127.0.0.1:$port TROUPE_FORWARDER_PID=$FORWARDER_PID

# A server with TLS and two keys.
server=target/${TROUPE_BUILD:-release}/troupe-server
secret=$home/secret
rm -rf "$secret" && mkdir -p "$secret"
openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2 -subj /CN=troupe -addext subjectAltName=IP:127.0.0.1 \
    -addext basicConstraints=critical,CA:FALSE -keyout "$secret/server.key" -out "$secret/server.pem" 2>"$secret/log"
for role in author drive; do "$server" key new --name "$role" --role "$role" >>"$secret/keys.toml"; done
mapfile -t keys < <(grep -o 'troupe_[0-9a-f]*' "$secret/keys.toml")
ORT_DYLIB_PATH=${ORT_DYLIB_PATH:-$PWD/.runtime/libonnxruntime.so} "$server" --listen 127.0.0.1:0 --packs models/human \
    --keys "$secret/keys.toml" --tls-certificate "$secret/server.pem" --tls-key "$secret/server.key" >"$secret/log" 2>&1 &
started+=($!)
for _ in $(seq 600); do
    url=$(sed -n 's|^Troupe serves .* on \(https://[^ ]*\)$|\1|p' "$secret/log")
    [ -z "$url" ] || break
    sleep 0.1
done
[ -n "$url" ] || { cat "$secret/log" >&2; exit 1; }
export TROUPE_TLS_SERVER=$url TROUPE_TLS_CA=$secret/server.pem TROUPE_TLS_AUTHOR_KEY=${keys[0]} TROUPE_TLS_DRIVE_KEY=${keys[1]}

# The editor notes the extension and the classes of scripts in the project, as it does when somebody opens it. Without a window it
# crashes at the end if it finds an extension for the first time (godotengine/godot#123511).
import=("$GODOT" --headless --path "$project" --import)
("${import[@]}" >"$home/import.log" 2>&1 || true) 2>/dev/null
"${import[@]}" >"$home/import.log" 2>&1 || { cat "$home/import.log" >&2; exit 1; }
"$GODOT" --headless --path "$project" --script res://engine.gd >"$home/engine.log" 2>&1 || { cat "$home/engine.log" >&2; exit 1; }
# A script that does not compile, and panics that Godot catches, end with 0.
if ! grep "checks passed$" "$home/engine.log" || grep -E "SCRIPT ERROR|panicked|ERROR:" "$home/engine.log" >&2; then
    cat "$home/engine.log" >&2
    exit 1
fi
left=$(curl --silent --fail "$TROUPE_SERVER/v1/sessions")
[[ $left != *'"id"'* ]] || { echo "sessions are left on the server: $left" >&2; exit 1; }
