#!/usr/bin/env python3
"""Memory of a server that serves all packs in models/, its time until ready, and what the first use of a shape costs.

Starts the server twice with an empty folder for its cache. The second one then answers every length of a segment in batches
of every size, for both packs, one request at a time. Then characters live. At last it says what memory was at its peak.

    scripts/measure-memory.py --live 400 --seconds 300
    scripts/measure-memory.py --server /elsewhere/troupe-server -- --engine cpu
"""

import argparse
import contextlib
import json
import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

ROOT = pathlib.Path(__file__).resolve().parent.parent
BATCHES = (1, 2, 3, 4, 5, 7, 8, 12, 16, 32)
# The shortest and the longest segment, frames, and the step from one length to the next.
FRAMES = range(12, 65, 4)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--server", default=ROOT / "target/release/troupe-server", help="the server's binary")
    parser.add_argument("--loadtest", default=ROOT / "target/release/troupe-loadtest", help="the load tester's")
    parser.add_argument("--live", type=int, default=400, help="characters that live")
    parser.add_argument("--seconds", type=int, default=300, help="how long they do")
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    parser.add_argument("flags", nargs="*", help="flags for the server")
    args = parser.parse_args()
    found: dict = {}
    with tempfile.TemporaryDirectory() as cache:
        with running(args, cache) as server:
            found["first_ready_s"] = server.ready_s
            found["first_ready_mib"] = memory(server.pid)
        with running(args, cache) as server:
            found["second_ready_s"] = server.ready_s
            found["second_ready_mib"] = memory(server.pid)
            found["first_use"] = first_uses(server.url)
            found["after_shapes_mib"] = memory(server.pid)
            if args.live and args.seconds:
                found["live"] = live(args, server.url)
            found["mib"] = memory(server.pid)
    if args.json:
        print(json.dumps(found, indent=2))
    else:
        show(found)
    return 0


class Server:
    """A server that is ready."""

    def __init__(self, pid: int, url: str, ready_s: float):
        self.pid, self.url, self.ready_s = pid, url, ready_s


@contextlib.contextmanager
def running(args: argparse.Namespace, cache: str):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    library = os.environ.get("ORT_DYLIB_PATH") or str(ROOT / ".runtime/libonnxruntime.so")
    environment = os.environ | {"TROUPE_CACHE": cache, "ORT_DYLIB_PATH": library}
    command = [str(args.server), "--listen", address, "--packs", str(ROOT / "models"), *args.flags]
    started = time.monotonic()
    process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    try:
        while not answers(f"http://{address}/readyz"):
            if process.poll() is not None or time.monotonic() - started > 300:
                sys.exit(f"the server is not ready: {process.stderr.read() if process.poll() is not None else ''}")
            time.sleep(0.01)
        yield Server(process.pid, f"http://{address}", time.monotonic() - started)
    finally:
        process.send_signal(signal.SIGTERM)
        try:
            process.communicate(timeout=30)
        except subprocess.TimeoutExpired:
            process.kill()


def answers(url: str) -> bool:
    try:
        with urllib.request.urlopen(url, timeout=5) as answer:
            return answer.status == 200
    except (urllib.error.URLError, OSError):
        return False


def memory(pid: int) -> dict:
    """Resident memory of a process now and at its peak, MiB."""
    status = pathlib.Path(f"/proc/{pid}/status").read_text()
    lines = dict(line.split(":", 1) for line in status.splitlines())
    return {name: round(int(lines[of].split()[0]) / 1024) for name, of in (("now", "VmRSS"), ("peak", "VmHWM"))}


def first_uses(url: str) -> list[dict]:
    """The time of the first request of every length and batch size, of every pack, and of the tenth."""
    with urllib.request.urlopen(f"{url}/v1/packs") as answer:
        packs = json.load(answer)["packs"]
    uses = []
    for pack in packs:
        for frames in FRAMES:
            for batch in BATCHES:
                body = request(pack, frames, batch)
                times = [post(f"{url}/v1/inbetween", body) for _ in range(10)]
                uses.append(
                    {"pack": pack["name"], "frames": frames, "batch": batch, "ms": times[0], "tenth_ms": times[-1]}
                )
    return uses


def request(pack: dict, frames: int, batch: int) -> bytes:
    """Characters that walk on, in the pack's rest pose."""

    def key(z: float) -> dict:
        rotations = [1.0, 0.0, 0.0, 0.0] * len(pack["joints"])
        return {"pose": {"rotations": rotations}, "root": {"position": {"x": 0.0, "y": 0.9, "z": z}}}

    character = {
        "context": [key(0.04 * frame) for frame in range(4)],
        "targets": [key(0.04 * (frames - 1))],
        "frame_count": frames,
    }
    characters = [character | {"id": str(index), "seed": index} for index in range(batch)]
    return json.dumps({"pack": pack["name"], "characters": characters}).encode()


def post(url: str, body: bytes) -> float:
    started = time.monotonic()
    call = urllib.request.Request(url, data=body, headers={"content-type": "application/json"})
    try:
        with urllib.request.urlopen(call) as answer:
            answer.read()
    except urllib.error.HTTPError as error:
        sys.exit(f"{url}: {error.code}: {error.read().decode()}")
    return 1000 * (time.monotonic() - started)


def live(args: argparse.Namespace, url: str) -> dict:
    command = [str(args.loadtest), "run", "--server", url, "--workload", "drive", "--characters", str(args.live)]
    with tempfile.NamedTemporaryFile(suffix=".json") as report:
        command += ["--duration", f"{args.seconds}s", "--quiet", "--json", report.name]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return json.load(report)["median"]


def percentile(values: list[float], share: float) -> float:
    return sorted(values)[min(len(values) - 1, int(share * len(values)))]


def show(found: dict) -> None:
    uses = found["first_use"]
    # What a request of as many characters takes by itself is not the cost of a first use.
    costs = [use["ms"] - use["tenth_ms"] for use in uses]
    worst = max(uses, key=lambda use: use["ms"] - use["tenth_ms"])
    print(f"ready: first start {found['first_ready_s']:.2f} s, second {found['second_ready_s']:.2f} s")
    for name, what in (
        ("first_ready_mib", "ready, first start"),
        ("second_ready_mib", "ready, second start"),
        ("after_shapes_mib", "after all lengths and batch sizes"),
        ("mib", "at the end"),
    ):
        print(f"resident, {what}: {found[name]['now']} MiB, peak {found[name]['peak']} MiB")
    print(
        f"first use of a shape beside the tenth, {len(uses)} shapes: median {percentile(costs, 0.5):.1f} ms, "
        f"p99 {percentile(costs, 0.99):.1f} ms, most {max(costs):.1f} ms "
        f"({worst['pack']}, {worst['frames']} frames, {worst['batch']} characters)"
    )


if __name__ == "__main__":
    sys.exit(main())
