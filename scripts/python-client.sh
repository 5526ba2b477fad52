#!/usr/bin/env bash
# Builds the wheel of clients/python, installs it into target/python-client, checks its types and runs its tests against a real
# server, if one is built. Arguments go to pytest.
set -euo pipefail
cd "$(dirname "$0")/.."

home=target/python-client
client=clients/python
stamp=$home/$(cksum <$client/requirements.txt | cut -d' ' -f1).ok
pip=("$home/bin/python" -m pip --disable-pip-version-check)
if [ ! -f "$stamp" ]; then
    python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Python 3.11 or newer is needed" >&2; exit 1; }
    rm -rf "$home"
    python3 -m venv "$home"
    "${pip[@]}" install --quiet -r $client/requirements.txt
    touch "$stamp"
fi
rm -rf target/python-wheel
# A copy, so that nothing is built among the sources.
mkdir -p target/python-wheel
cp -r $client target/python-wheel/source
"${pip[@]}" wheel --quiet --no-deps --no-build-isolation --wheel-dir target/python-wheel target/python-wheel/source
"${pip[@]}" install --quiet --no-deps --force-reinstall target/python-wheel/*.whl
# With the reader the client reads files of every format. Its tests cover both: with it and without.
if compgen -G 'target/reader/*.whl' >/dev/null; then
    "${pip[@]}" install --quiet --no-deps --force-reinstall target/reader/*.whl
fi
"${pip[@]}" check
"$home/bin/python" $client/scripts/generate.py --check
MYPYPATH=$client "$home/bin/mypy" --config-file mypy.ini $client/troupe $client/scripts
"$home/bin/python" -m pytest --quiet -c $client/pyproject.toml --rootdir $client $client/tests "$@"
