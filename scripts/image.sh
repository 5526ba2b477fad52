#!/usr/bin/env bash
# Builds the image of the Dockerfile, runs it and checks the promises of docs/docker.md. Prints a table of the checks, and
# exits with 1 if one fails. RUNTIME=cpu|openvino|gpu chooses the runtime. `image.sh --prepare` only gets the tools and packages
# that it needs, and fails if it cannot get them.
#
# It needs no container engine and pulls no image: buildah builds and runs in a chroot, on stand-ins that have the names of the
# Dockerfile's base images. They are made from Debian's packages and the Rust toolchain at hand. Root and Debian's apt are
# needed. All that it makes is in target/image.
set -euo pipefail
cd "$(dirname "$0")/.."

runtime=${RUNTIME:-cpu}
# Most megabytes of the image, the base image included: budgets.toml says it for cpu, and what the other runtimes add is here.
cpu_mb=$(sed -n 's/^image_mb = \([0-9]*\)$/\1/p' budgets.toml)
case $runtime in
cpu) most_mb=$cpu_mb ;;
openvino) most_mb=$((cpu_mb + 65)) ;;
gpu) most_mb=$((cpu_mb + 1470)) ;;
*) echo "RUNTIME is $runtime; allowed: cpu, openvino, gpu" >&2; exit 2 ;;
esac
image=troupe:$runtime
# Least gigabytes that the disk must have free: the build's layers and caches are copies.
least_free_gb=6
# Most seconds until the server is ready, and until it has stopped: its default drain_timeout_ms and some more.
most_ready_s=60
most_stop_s=12

work=$PWD/target/image
# buildah keeps the caches of the Dockerfile's RUN --mount=type=cache under TMPDIR.
export TMPDIR=$work/tmp
mkdir -p "$TMPDIR/buildah-cache"
SECONDS=0
note() { printf '%4d s  %s\n' "$SECONDS" "$*"; }
fail() { echo "image.sh: $*" >&2; exit 1; }
bud() { buildah --root "$work/storage" --runroot "$work/run" --storage-driver vfs "$@"; }

# ---- Build ----

install_tools() {
    local missing=() tool package
    while read -r tool package; do
        command -v "$tool" >/dev/null || missing+=("$package")
    done <<<"buildah buildah
mmdebstrap mmdebstrap
ip iproute2
curl curl"
    [ ${#missing[@]} -gt 0 ] || return 0
    command -v apt-get >/dev/null || fail "install ${missing[*]}; without apt this script cannot"
    note "installing ${missing[*]}"
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >"$work/apt.log" 2>&1 || {
        cat "$work/apt.log" >&2
        fail "apt-get install failed"
    }
}

has_image() { bud inspect --type image "$1" >/dev/null 2>&1; }

# The value of an ARG of the Dockerfile.
default_of() { sed -n "s/^ARG $1=//p" Dockerfile; }

# A Debian like the small one of the public library, under the same name.
stand_in_base() {
    local name=$1 suite=${1##*:} container root
    ! has_image "$name" || return 0
    note "making a stand-in for $name"
    container=$(bud from scratch)
    root=$(bud mount "$container")
    mmdebstrap --quiet --variant=minbase --include=usr-is-merged --hook-dir=/usr/share/mmdebstrap/hooks/merged-usr \
        --dpkgopt='path-exclude=/usr/share/man/*' --dpkgopt='path-exclude=/usr/share/locale/*' \
        --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-include=/usr/share/doc/*/copyright' \
        "${suite%%-*}" "$work/base.tar" >"$work/base.log" 2>&1 || { cat "$work/base.log" >&2; fail "no stand-in for $name"; }
    tar -xf "$work/base.tar" -C "$root"
    rm "$work/base.tar"
    bud config --cmd bash "$container"
    bud commit --quiet --rm --format docker "$container" "$name" >/dev/null
}

# The compilers, under the name of the Rust image. The toolchain itself is mounted while the image is built.
stand_in_rust() {
    local name=$1 base=$2 container
    ! has_image "$name" || return 0
    note "making a stand-in for $name"
    container=$(bud from --pull-never "$base")
    bud run --isolation chroot --env DEBIAN_FRONTEND=noninteractive "$container" -- sh -ec '
        apt-get update -qq
        apt-get install -y -qq --no-install-recommends ca-certificates gcc libc6-dev make python3
        apt-get clean
        rm -rf /var/lib/apt/lists/*' >"$work/rust.log" 2>&1 || { cat "$work/rust.log" >&2; fail "no stand-in for $name"; }
    bud config --env CARGO_HOME=/usr/local/cargo --env PATH=/usr/local/toolchain/bin:/usr/sbin:/usr/bin:/sbin:/bin "$container"
    bud commit --quiet --rm --format docker "$container" "$name" >/dev/null
}

# The disk has room, or an earlier build is there to go on with.
check_room() {
    local free_gb used_gb
    free_gb=$(df --output=avail --block-size=1G "$work" | tail -n 1)
    used_gb=$(du -s --block-size=1G "$work" | cut -f1)
    [ $((free_gb + used_gb)) -ge "$least_free_gb" ] ||
        fail "the disk has ${free_gb// /} GB free; building the image needs $least_free_gb GB"
}

# The tools and the stand-ins, and whether namespaces are to be had.
prepare() {
    local base rust
    check_room
    install_tools
    base=$(default_of BASE_IMAGE) rust=$(default_of RUST_IMAGE)
    # What a run has left that was killed.
    bud rm --all >/dev/null 2>&1 || true
    rm -rf --one-file-system "$TMPDIR"/buildah[0-9]*
    stand_in_base "$base"
    stand_in_rust "$rust" "$base"
    unshare --net --mount --pid --fork --kill-child --mount-proc true || fail "this machine gives no namespaces"
}

build() {
    local registry=${CARGO_HOME:-$HOME/.cargo}/registry certificates=/etc/ssl/certs/ca-certificates.crt
    # The crates that cargo has already fetched here.
    mkdir -p "$registry"
    ln -sfn "$registry" "$TMPDIR/buildah-cache/troupe-cargo"
    # The authorities that this machine trusts: behind some proxies pip works with those alone.
    local volumes=(--volume "$(rustc --print sysroot):/usr/local/toolchain:ro")
    [ ! -f "$certificates" ] || volumes+=(--volume "$certificates:$certificates:ro")
    note "building $image"
    bud build --isolation chroot --format docker --pull-never --tag "$image" \
        "${volumes[@]}" --build-arg "RUNTIME=$runtime" --build-arg "REVISION=$(git rev-parse HEAD 2>/dev/null || echo unknown)" \
        . >"$work/build.log" 2>&1 || { tail -n 50 "$work/build.log" >&2; fail "the build failed; all of it: $work/build.log"; }
    # What an earlier build has left.
    bud rmi --prune >/dev/null 2>&1 || true
    # How long each crate took, for scripts/budgets.py.
    cp "$TMPDIR"/buildah-cache/troupe-target/cargo-timings/cargo-timing.html "$work/" 2>/dev/null || true
    note "built"
}

# ---- Check: in namespaces of its own, so port 8080 is free and every process ends with the script ----

proofs=$work/proofs.txt
prove() { printf '%-22s %s\n' "$1" "$2" >>"$proofs"; }

# What the image says of itself, by a Go template. A list has one element a line.
config() { bud inspect --type image --format "$1" "$image"; }
list() { config "{{range .Docker.Config.$1}}{{println .}}{{end}}" | sed '/^$/d'; }

in_container() { bud run --isolation chroot "$container" -- "$@"; }

server_pid() {
    local process
    for process in /proc/[0-9]*; do
        [ "$(cat "$process/comm" 2>/dev/null)" != troupe-server ] || { echo "${process#/proc/}"; return; }
    done
}

# Starts the command in the background and waits until the server is ready: serve LOG COMMAND...
serve() {
    local log=$1 start=$EPOCHREALTIME
    shift
    "$@" >"$log" 2>&1 &
    runner=$!
    until curl --silent --fail --output "$work/readyz" http://127.0.0.1:8080/readyz; do
        kill -0 "$runner" 2>/dev/null || { cat "$log" >&2; fail "the server has ended"; }
        awk "BEGIN { exit !($EPOCHREALTIME - $start > $most_ready_s) }" &&
            { cat "$log" >&2; fail "not ready after $most_ready_s s"; }
        sleep 0.1
    done
    ready_s=$(awk "BEGIN { printf \"%.1f\", $EPOCHREALTIME - $start }")
    pid=$(server_pid)
    [ -n "$pid" ] || fail "no process is called troupe-server"
    # The server prints its key once it is ready.
    for _ in {1..50}; do
        key=$(sed -n 's/^  export TROUPE_KEY=//p' "$log")
        [ -z "$key" ] || return 0
        sleep 0.1
    done
    fail "the server has printed no key"
}

# Sends the image's stop signal and wants a clean end: stop LOG
stop() {
    local start=$EPOCHREALTIME code=0
    kill -s "$(config '{{.Docker.Config.StopSignal}}')" "$pid"
    wait "$runner" || code=$?
    stop_s=$(awk "BEGIN { printf \"%.1f\", $EPOCHREALTIME - $start }")
    [ "$code" = 0 ] || { cat "$1" >&2; fail "after the stop signal the server's exit code is $code"; }
    awk "BEGIN { exit !($stop_s <= $most_stop_s) }" || fail "the server took $stop_s s to stop"
}

# One request, and how many frames its answer has.
in_between() {
    curl --silent --show-error --fail http://127.0.0.1:8080/v1/inbetween -H 'content-type: application/json' \
        -H "authorization: Bearer $key" \
        --data @examples/request.json | python3 -c '
import json, sys
frames = json.load(sys.stdin)["characters"][0]["frames"]
count, roots, rotations = frames["frame_count"], frames["root_positions"], frames["rotations"]
if count < 12 or len(roots) != 3 * count or not rotations or len(rotations) % (4 * count) != 0:
    sys.exit(f"{count} frames with {len(roots)} and {len(rotations)} numbers")
print(count)'
}

# Every file of the container with its kind, mode, owner, size, time and target. buildah makes and removes a file in /run
# whenever it runs something, so the time of that folder says nothing. /var/lib/troupe is for the server to write to.
snapshot() { (cd "$root" && find . ! -path ./run ! -path './var/lib/troupe*' -printf '%p %y %m %U:%G %s %T@ %l\n' | LC_ALL=C sort); }

check_size() {
    local mb
    mb=$(du -s --apparent-size --block-size=1000000 "$root" | cut -f1)
    [ "$mb" -le "$most_mb" ] || fail "the image has $mb MB; allowed: $most_mb"
    prove "size" "$mb MB (at most $most_mb)"
    image_mb=$mb
}

check_labels() {
    local pack name licence terms label licences
    licences=$(config '{{index .Docker.Config.Labels "org.opencontainers.image.licenses"}}')
    for pack in models/*/pack.toml; do
        name=$(sed -n 's/^name = "\(.*\)"/\1/p' "$pack" | head -n 1)
        licence=$(sed -n 's/^licence = "\(.*\)"/\1/p' "$pack")
        label=$(config "{{index .Docker.Config.Labels \"troupe.weights.$name\"}}")
        terms=$licence
        [[ $licence != *-NC* ]] || terms+=", non-commercial"
        [[ $label == "$terms"* ]] || fail "label troupe.weights.$name is '$label'; the pack says $licence"
        [[ $licences == *"${licence// /-}"* ]] || fail "label org.opencontainers.image.licenses lacks $licence: $licences"
        prove "label of $name" "$label"
    done
}

check_user() {
    local user uid gid
    user=$(config '{{.Docker.Config.User}}')
    uid=$(awk '/^Uid:/ { print $2 "," $3 "," $4 "," $5 }' "/proc/$pid/status")
    gid=$(awk '/^Gid:/ { print $2 "," $3 "," $4 "," $5 }' "/proc/$pid/status")
    [ "$uid/$gid" = "10001,10001,10001,10001/10001,10001,10001,10001" ] || fail "the server runs as $uid/$gid"
    grep -q '^CapEff:[[:space:]]*0*$' "/proc/$pid/status" || fail "the server has capabilities"
    prove "user" "$user, no capabilities (of /proc/PID/status)"
}

# For scripts/budgets.py: sizes, and the resident memory of the server that is ready and has answered nothing yet.
write_figures() {
    local rss_mib binary
    rss_mib=$(awk '/^VmRSS:/ { print int($2 / 1024) }' "/proc/$pid/status")
    binary=$(stat --format %s "$root/usr/local/bin/troupe-server")
    printf '{"image_mb": %d, "ready_rss_mib": %d, "binary_mb": %.1f, "runtime": "%s"}\n' \
        "$image_mb" "$rss_mib" "$(awk "BEGIN { print $binary / 1e6 }")" "$runtime" >"$work/figures.json"
    prove "memory" "$rss_mib MiB resident when ready"
}

# Every metric that the dashboard asks for is exported.
check_dashboard() {
    local metric count=0
    curl --silent --fail --output "$work/metrics" -H "authorization: Bearer $key" http://127.0.0.1:8080/metrics
    while read -r metric; do
        grep -qE "^${metric}[{ ]" "$work/metrics" || fail "the dashboard asks for $metric, which the server does not export"
        count=$((count + 1))
    done < <(grep -ohE '\b(troupe|process)_[a-z0-9_]+' deploy/grafana/dashboards/*.json | sort -u)
    [ "$count" -gt 0 ] || fail "the dashboard asks for nothing"
    prove "dashboard" "all $count metrics that it asks for are exported"
}

# The page at / has all that it names, and a character walks a second at the commanded pace.
check_viewer() {
    local asset count=0 metres
    curl --silent --fail --output "$work/viewer.html" http://127.0.0.1:8080/
    while read -r asset; do
        curl --silent --fail --output /dev/null "http://127.0.0.1:8080$asset" || fail "the viewer lacks $asset"
        count=$((count + 1))
    done < <(grep -oE '/assets/[^"]+' "$work/viewer.html")
    [ "$count" -gt 1 ] || fail "/ does not show the viewer"
    ask() {
        curl --silent --show-error --fail "http://127.0.0.1:8080$1" -H 'content-type: application/json' \
            -H "authorization: Bearer $key" --data "$2"
    }
    ask /v1/sessions '{"sessions": [{"id": "walker"}]}' >/dev/null
    metres=$(ask /v1/step '{"session_ids": ["walker"], "frames": 60, "commands": [{"session_id": "walker", "sequence": 1,
        "locomote": {"velocity": {"x": 0, "y": 0, "z": 1.2}}}]}' | python3 -c '
import json, sys
roots = json.load(sys.stdin)["blocks"][0]["root_positions"]
print(f"{roots[-1] - roots[-91]:.2f}")')
    awk "BEGIN { exit !($metres > 0.8 && $metres < 1.6) }" || fail "a walk of a second takes a character $metres m, not about 1.2"
    prove "viewer" "/ and its $count files; a character walks $metres m in a second"
}

# The image has the site of the documentation.
check_docs() {
    curl --silent --fail --output "$work/docs.html" http://127.0.0.1:8080/docs/
    grep -q tutorials/first-character.html "$work/docs.html" || fail "/docs/ does not show the documentation"
    prove "documentation" "/docs/ shows it"
}

check() {
    local entry health environment frames
    here=$work/read-only
    : >"$proofs"
    ip link set lo up
    container=$(bud from --pull-never "$image")
    trap 'umount --recursive --lazy "$here" 2>/dev/null || true; bud rm "$container" >/dev/null' EXIT
    root=$(bud mount "$container")
    mapfile -t entry < <(list Entrypoint)
    mapfile -t health < <(list Healthcheck.Test)
    mapfile -t environment < <(list Env)
    [ "${health[0]}" = CMD ] || fail "the health check is no command: ${health[*]}"
    check_size
    check_labels

    # As the image says: its user, its command, its environment.
    in_container "${entry[@]}" --version >/dev/null # Makes what any run makes, /etc/hosts say.
    snapshot >"$work/before.txt"
    serve "$work/server.log" in_container "${entry[@]}"
    check_user
    prove "ready" "after $ready_s s (at most $most_ready_s)"
    write_figures
    in_container "${health[@]:1}" >"$work/health.log" 2>&1 || { cat "$work/health.log" >&2; fail "the health check fails"; }
    frames=$(in_between)
    prove "in-between" "$frames frames"
    check_dashboard
    check_viewer
    check_docs
    stop "$work/server.log"
    prove "SIGTERM" "exit code 0 after $stop_s s (at most $most_stop_s)"
    ! in_container "${health[@]:1}" >"$work/health.log" 2>&1 || fail "the health check succeeds without a server"
    prove "health check" "exit code 0 while it served, 1 after it had stopped"
    snapshot >"$work/after.txt"
    diff "$work/before.txt" "$work/after.txt" >&2 || fail "the server has changed files"
    prove "files" "none of $(wc -l <"$work/after.txt") made, changed or removed"

    # Once more on a root that the kernel keeps from being written, with one pack mounted in the place of those in the image.
    mkdir -p "$here"
    mount --bind -o ro "$root" "$here"
    mount -t proc proc "$here/proc"
    mount --rbind /sys "$here/sys"
    mount --bind /dev "$here/dev"
    mount --bind -o ro models/human "$here/opt/troupe/models"
    ! touch "$here/opt/troupe/x" 2>/dev/null || fail "the root can be written to"
    serve "$work/read-only.log" env -i "${environment[@]}" \
        chroot --userspec="$(config '{{.Docker.Config.User}}')" "$here" "${entry[@]}"
    frames=$(in_between)
    stop "$work/read-only.log"
    prove "read-only root" "bind mount: ready after $ready_s s, $frames frames, stopped with 0"
    prove "mounted pack" "$(grep -c '^  pack ' "$work/read-only.log") pack served, of $(find models -name pack.toml | wc -l) in the image"
}

[ "$(id -u)" = 0 ] || fail "root is needed, for chroot, mounts and namespaces"
if [ "${1:-}" = --check ]; then
    check
    exit 0
fi
prepare
[ "${1:-}" != --prepare ] || exit 0
build
note "checking $image"
unshare --net --mount --pid --fork --kill-child --mount-proc "$PWD/scripts/image.sh" --check
note "done"
echo
echo "$image: what scripts/image.sh proved"
sed 's/^/  /' "$proofs"
