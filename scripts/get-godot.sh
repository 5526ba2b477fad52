#!/usr/bin/env bash
# Puts Godot 4 of Debian's suite unstable, and the libraries that it needs, into target/godot/engine, about 160 MB to download. It
# installs nothing. It needs apt. GODOT=target/godot/engine/godot runs it. Does nothing if the folder is there.
set -euo pipefail
cd "$(dirname "$0")/.."

home=$PWD/target/godot/engine
[ ! -x "$home/godot" ] || exit 0
command -v apt-get >/dev/null || { echo "this needs apt: name a Godot of your own in GODOT" >&2; exit 1; }

# The mirror that this machine uses for Debian.
sites=$(apt-get indextargets --format '$(SITE)' 'Created-By: Packages' | grep '/debian/\?$')
site=${sites%%$'\n'*}
state=$PWD/target/godot/apt
rm -rf "$state" "$home"
mkdir -p "$state"/{lists,cache}/partial "$state/cache/archives/partial" "$home"
: >"$state/status"
echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] $site unstable main" >"$state/sources.list"
apt=(apt-get --quiet --yes -o "Dir::State=$state" -o "Dir::State::status=$state/status" -o "Dir::Cache=$state/cache"
    -o "Dir::Etc::sourcelist=$state/sources.list" -o Dir::Etc::sourceparts=- -o APT::Sandbox::User=root)

echo "Getting Godot into $home ..."
"${apt[@]}" update >"$state/log" 2>&1 || { cat "$state/log" >&2; exit 1; }
# Nothing counts as installed, so all libraries come too.
"${apt[@]}" --no-install-recommends --download-only install godot >>"$state/log" 2>&1 || { cat "$state/log" >&2; exit 1; }
for package in "$state"/cache/archives/*.deb; do dpkg-deb --extract "$package" "$home"; done
rm -rf "$state"

# With the loader and the libraries that came along.
cat >"$home/godot" <<'END'
#!/usr/bin/env bash
home=$(cd "$(dirname "$0")" && pwd)
libraries=$(echo "$home"/usr/lib/*-linux-gnu*)
exec "$libraries"/ld-linux-*.so.* --library-path "$libraries:$libraries/pulseaudio" "$home/usr/bin/godot" "$@"
END
chmod +x "$home/godot"
"$home/godot" --version
