#!/usr/bin/env bash
# Tests the C interface of the client and the clients above it, against the server of TROUPE_SERVER or one that it starts: the example
# and a C program of tests, plain and with sanitizers, an installed package, and C# under Mono. It uses target/debug, which the Rust
# tests build, unless TROUPE_LIBRARY names a folder with libtroupe_c.so and libtroupe_c.a. What a machine lacks is left out, aloud.
set -euo pipefail
cd "$(dirname "$0")/.."
if [ -z "${TROUPE_SERVER:-}" ]; then
    export TROUPE_BUILD=${TROUPE_BUILD:-debug}
    exec scripts/with-server.sh "$0" "$@"
fi

lacks() { echo "*** $1" >&2; }

home=$PWD/target/c-client
mkdir -p "$home"
if [ -z "${TROUPE_LIBRARY:-}" ]; then
    cargo test --workspace --locked --no-run --test generated
    TROUPE_LIBRARY=$PWD/target/debug/deps
fi
so=$TROUPE_LIBRARY/libtroupe_c.so
[ -f "$so" ] || { echo "there is no $so: cargo build -p troupe-c" >&2; exit 1; }
export LD_LIBRARY_PATH=$TROUPE_LIBRARY${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
python3 clients/conventions/make.py --check

# A connection that breaks: the tests of C go through this one, too.
address=${TROUPE_SERVER#*://}
coproc FORWARDER { exec python3 clients/c/tests/forwarder.py "${address%/}"; }
forwarder=$FORWARDER_PID
trap 'kill "$forwarder" 2>/dev/null || true' EXIT
read -r port <&"${FORWARDER[0]}"
export TROUPE_FORWARDER=http://127.0.0.1:$port TROUPE_FORWARDER_PID=$forwarder

build_c() { # OUT SANITIZE
    if command -v cmake >/dev/null; then
        cmake -S clients/c -B "$1" -DTROUPE_LIBRARY="$so" -DTROUPE_SANITIZE="$2" >"$1.log" && cmake --build "$1" >>"$1.log" ||
            { cat "$1.log" >&2; return 1; }
        return
    fi
    local flags=(-std=c11 -D_GNU_SOURCE -Wall -Wextra -Werror -Iclients/c/include)
    if [ "$2" = ON ]; then flags+=(-g "-fsanitize=address,undefined" -fno-sanitize-recover=all); else flags+=(-DCOUNT_ALLOCATIONS); fi
    mkdir -p "$1"
    gcc "${flags[@]}" clients/c/examples/walk.c -o "$1/walk" "$so" -lm
    gcc "${flags[@]}" clients/c/tests/abi.c -o "$1/abi" "$so" -lm -pthread
}

command -v cmake >/dev/null || lacks "THE CMAKE PACKAGE WAS NOT TESTED: there is no cmake; gcc builds the programs"
for sanitize in OFF ON; do
    echo "C, with sanitizers $sanitize"
    build_c "$home/sanitize-$sanitize" "$sanitize"
    ASAN_OPTIONS=detect_leaks=1 "$home/sanitize-$sanitize/abi"
    ASAN_OPTIONS=detect_leaks=1 "$home/sanitize-$sanitize/walk" "$TROUPE_SERVER" 2
done

# The program of a tutorial, as its page has it, but for the server's address.
of_page() { # PAGE LANGUAGE TEXT-OF-THE-BLOCK
    python3 - "$@" <<'END'
import os, re, sys
page, language, text = sys.argv[1:]
blocks = re.findall(rf"^```{language}\n(.*?)^```", open(page, encoding="utf-8").read(), re.DOTALL | re.MULTILINE)
(block,) = (block for block in blocks if text in block)
print(block.replace("http://127.0.0.1:8080", os.environ["TROUPE_SERVER"]))
END
}
echo "C, as the tutorial has it"
of_page docs/tutorials/c.md c 'int main' >"$home/walk.c"
gcc -std=c11 -Wall -Wextra -Werror -Iclients/c/include "$home/walk.c" -o "$home/walk" "$so"
"$home/walk" | tee "$home/walk.txt"
[ "$(wc -l <"$home/walk.txt")" = 3 ]

# The header in C++, and the static library.
g++ -std=c++17 -Wall -Wextra -Werror -fsyntax-only -x c++ clients/c/include/troupe.h
if [ -f "$TROUPE_LIBRARY/libtroupe_c.a" ]; then
    gcc -Iclients/c/include clients/c/examples/walk.c -o "$home/walk-static" "$TROUPE_LIBRARY/libtroupe_c.a" -lm -lpthread -ldl
    "$home/walk-static" "$TROUPE_SERVER" 0.1 >/dev/null
fi

if command -v cmake >/dev/null; then
    echo "C, as an installed package"
    cmake --install "$home/sanitize-OFF" --prefix "$home/installed" >"$home/install.log"
    cmake -S clients/c/examples -B "$home/example" -DCMAKE_PREFIX_PATH="$home/installed" >>"$home/install.log"
    cmake --build "$home/example" >>"$home/install.log" || { cat "$home/install.log" >&2; exit 1; }
    "$home/example/walk" "$TROUPE_SERVER" 0.1 >/dev/null
fi

# The conversions of the clients whose engines are not here.
for test in clients/*/tests/axes.cpp; do
    [ -f "$test" ] || continue
    g++ -std=c++17 -Wall -Wextra -Werror "$test" -o "$home/axes"
    "$home/axes" clients/conventions/poses.json
done

if command -v mcs >/dev/null && command -v mono >/dev/null; then
    echo "C#"
    find clients/unity/Runtime -name '*.cs' -print0 |
        xargs -0 mcs -unsafe -warnaserror -out:"$home/Program.exe" clients/unity/Tests~/Program.cs
    mono "$home/Program.exe" clients/conventions/poses.json
    echo "C#, as the tutorial has it"
    of_page docs/tutorials/unity.md csharp 'static void Main' >"$home/Walk.cs"
    find clients/unity/Runtime -name '*.cs' -print0 |
        xargs -0 mcs -unsafe -warnaserror -out:"$home/Walk.exe" "$home/Walk.cs"
    mono "$home/Walk.exe" "$TROUPE_SERVER"
else
    lacks "THE C# CLIENT WAS NOT TESTED: there is no mono (Debian: mono-mcs, mono-runtime)"
fi
