#!/bin/sh
# Installs a release of Troupe without building anything:
#   install.sh ARCHIVE.tar.gz [PREFIX]      PREFIX is ~/.local unless given
# The archive goes to PREFIX/lib/troupe/NAME, links to its programs into PREFIX/bin. ARCHIVE.sha256, if it lies beside
# the archive, is checked first. To remove an installation, delete that folder and the links.
set -eu

usage() {
    echo "usage: install.sh ARCHIVE.tar.gz [PREFIX]" >&2
    exit 2
}
[ $# -ge 1 ] && [ $# -le 2 ] || usage
archive=$1
prefix=${2:-$HOME/.local}
[ -f "$archive" ] || { echo "install.sh: there is no file $archive; make one with scripts/release.sh, or download a release" >&2; exit 1; }

case $(uname -s) in
Darwin) check="shasum -a 256" ;;
*) check=sha256sum ;;
esac
sums=${archive%.tar.gz}.sha256
if [ -f "$sums" ]; then
    wanted=$(awk -v file="$(basename "$archive")" '$2 == file { print $1 }' "$sums")
    found=$($check "$archive" | cut -d' ' -f1)
    [ "$wanted" = "$found" ] || { echo "install.sh: $archive is damaged: its SHA-256 is $found, $sums says $wanted" >&2; exit 1; }
else
    echo "install.sh: $sums is missing, so the archive was not checked" >&2
fi

name=$(tar -tzf "$archive" | head -n 1 | cut -d/ -f1)
case $name in
troupe-*) ;;
*) echo "install.sh: $archive is no release of Troupe: it begins with '$name'" >&2; exit 1 ;;
esac
home=$prefix/lib/troupe
mkdir -p "$home" "$prefix/bin"
rm -rf "${home:?}/$name.partial" "${home:?}/$name"
mkdir "$home/$name.partial"
tar -xzf "$archive" -C "$home/$name.partial" --strip-components 1
mv "$home/$name.partial" "$home/$name"
for program in "$home/$name"/bin/*; do
    ln -sf "$program" "$prefix/bin/"
done

cat <<TEXT
Troupe is installed in $home/$name. All packs in it are for non-commercial use (NOTICE).
  $prefix/bin/troupe-server          serves them: open http://127.0.0.1:8080
  $prefix/bin/troupe --help          the command line
TEXT
case :$PATH: in
*":$prefix/bin:"*) ;;
*) echo "$prefix/bin is not in your PATH." ;;
esac
