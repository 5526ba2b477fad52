"""A pack of the public MotionBricks release, served: a character lives on it, and what does not fit is refused by name.

Left out, aloud, where `make rust-test` has not built a server.
"""

import json
import os
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from release_support import G1, write_release
from troupe_training.cli.main import main

ROOT = Path(__file__).parents[3]
SERVER = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "debug" / "troupe-server"
LIBRARY = os.environ.get("ORT_DYLIB_PATH", str(ROOT / ".runtime" / "libonnxruntime.so"))
READY_S = 120


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    if not SERVER.exists():
        pytest.skip(f"there is no {SERVER}")
    release = write_release(tmp_path_factory.mktemp("release"))
    packs = tmp_path_factory.mktemp("packs")
    assert main(["import-motionbricks", str(release), "--out", str(packs / "g1-official"), "--like", str(G1)]) == 0
    # Random weights need not pass.
    options = ("--packs", str(packs), "--listen", "127.0.0.1:0", "--store", "", "--accuracy-check", "report")
    log = packs / "log.txt"
    with log.open("w") as out:
        process = subprocess.Popen(
            [SERVER, *options, "--engine", "cpu"], stdout=out, stderr=out, env=os.environ | {"ORT_DYLIB_PATH": LIBRARY}
        )
    try:
        yield served_at(process, log)
    finally:
        process.kill()
        process.wait()


def served_at(process: subprocess.Popen[bytes], log: Path) -> str:
    end = time.monotonic() + READY_S
    while time.monotonic() < end and process.poll() is None:
        for line in log.read_text().splitlines():
            if line.startswith("Troupe serves "):
                return line.rsplit(" on ", 1)[1]
        time.sleep(0.1)
    raise AssertionError(log.read_text()[-2000:])


def ask(url: str, path: str, body: Any) -> tuple[int, Any]:
    """Status and answer of a POST."""
    request = urllib.request.Request(url + path, json.dumps(body).encode(), {"content-type": "application/json"})
    try:
        with urllib.request.urlopen(request) as answer:
            return answer.status, json.load(answer)
    except urllib.error.HTTPError as error:
        return error.code, json.load(error)


def test_a_robot_lives_on_it_in_the_styles_of_its_clips(url: str):
    names = {"a": "zombie", "b": "normal"}
    options = [{"id": name, "pack": "g1-official", "style": style} for name, style in names.items()]
    status, answer = ask(url, "/v1/sessions", {"sessions": options})
    assert status == 200, answer
    commands = [{"session_id": name, "sequence": "1", "locomote": {"velocity": {"z": 0.8}}} for name in names]
    status, answer = ask(url, "/v1/commands", {"commands": commands})
    assert status == 200 and not any(one.get("problem") for one in answer["results"]), answer
    for _ in range(4):
        status, answer = ask(url, "/v1/step", {"session_ids": [*names], "frames": 30})
        assert status == 200, answer
        (block,) = answer["blocks"]
        turns = np.array(block["rotations"], float).reshape(len(names), 30, -1, 4)
        assert np.allclose(np.linalg.norm(turns, axis=-1), 1, atol=1e-3)
        assert np.isfinite(np.array(block["root_positions"], float)).all()
