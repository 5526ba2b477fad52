"""A real server for the tests that need one, and skeletons for those that do not."""

import os
import re
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import troupe

ROOT = Path(__file__).resolve().parents[3]
READY_S = 180


def _binary() -> Path | None:
    named = os.environ.get("TROUPE_SERVER", "")
    if named and not named.startswith("http"):
        return Path(named)
    built = (ROOT / "target" / kind / "troupe-server" for kind in ("release", "debug"))
    return next((path for path in built if path.exists()), None)


@pytest.fixture(scope="session")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """HOST:PORT of a server: the one that runs at the address in TROUPE_SERVER, or one of the tests' own."""
    named = os.environ.get("TROUPE_SERVER", "")
    if named.startswith("http"):
        yield named.removeprefix("http://")
        return
    binary = _binary()
    if binary is None:
        pytest.skip("no server: set TROUPE_SERVER to the path of troupe-server, or build it into target/release")
    server = Server(binary, tmp_path_factory.mktemp("server"))
    yield server.start()
    server.stop()


@pytest.fixture(scope="session")
def words_address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """HOST:PORT of a server of the tests' own, whose one pack knows words: its weights are random."""
    binary = _binary()
    if binary is None:
        pytest.skip("no server's binary: set TROUPE_SERVER to its path, or build it into target/release")
    server = Server(binary, tmp_path_factory.mktemp("words"), "--packs", "engine/tests/vermo")
    yield server.start()
    server.stop()


@pytest.fixture
def words(words_address: str) -> Iterator[troupe.Client]:
    with troupe.Client(words_address) as client:
        yield client


class Server:
    """A server of the tests' own, which may be started again on the same port with what it kept."""

    def __init__(self, binary: Path, folder: Path, *options: str) -> None:
        self._command = [str(binary), "--store", str(folder / "store"), *options]
        self._log = folder / "log"
        self._port = 0
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> str:
        runtime = os.environ.get("ORT_DYLIB_PATH", str(ROOT / ".runtime" / "libonnxruntime.so"))
        if not Path(runtime).exists():
            pytest.skip(f"no ONNX Runtime at {runtime}: run make runtime, or set ORT_DYLIB_PATH")
        with self._log.open("wb") as log:
            listen = ["--listen", f"127.0.0.1:{self._port}"]
            environment = os.environ | {"ORT_DYLIB_PATH": runtime}
            environment.pop("TROUPE_SERVER", None)
            self._process = subprocess.Popen(
                [*self._command, *listen], cwd=ROOT, env=environment, stdout=log, stderr=subprocess.STDOUT
            )
        until = time.monotonic() + READY_S
        while time.monotonic() < until and self._process.poll() is None:
            found = re.search(r"Troupe serves .* on http://127\.0\.0\.1:(\d+)", self._log.read_text())
            if found:
                self._port = int(found[1])
                address = f"127.0.0.1:{self._port}"
                with troupe.Client(address) as client:
                    client.wait_ready(READY_S)
                return address
            time.sleep(0.1)
        raise AssertionError(f"the server did not start: {self._log.read_text()}")

    def stop(self, *, kill: bool = False) -> None:
        assert self._process is not None
        self._process.kill() if kill else self._process.terminate()
        self._process.wait(30)


@pytest.fixture
def own_server(tmp_path: Path) -> Iterator[Server]:
    """A server to be killed."""
    binary = _binary()
    if binary is None:
        pytest.skip("no server's binary: set TROUPE_SERVER to its path, or build it into target/release")
    server = Server(binary, tmp_path, "--packs", "models/human")
    yield server
    server.stop()


@pytest.fixture
def client(address: str) -> Iterator[troupe.Client]:
    with troupe.Client(address) as client:
        yield client


@pytest.fixture
def arm() -> troupe.Skeleton:
    """A pelvis with two limbs, whose joints are not in the order of the tree."""
    return troupe.Skeleton(
        names=("hips", "left", "right", "hand"),
        parents=(-1, 0, 0, 1),
        offsets=np.array([[0, 0, 0], [0.3, 0, 0], [-0.3, 0, 0], [0, -0.5, 0]], np.float32),
        contact_joints=("hand", "right"),
    )


@pytest.fixture
def robot() -> troupe.Skeleton:
    """A pelvis with a leg of two hinges and a fixed toe."""
    rest = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)
    hinges = (
        troupe.Hinge("hip", 1, (1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), -1.5, 1.5, 10),
        troupe.Hinge("knee", 2, (0.0, 0.6, 0.8), rest, -0.2, 2.5, 10),
    )
    return troupe.Skeleton(
        names=("pelvis", "hip", "knee", "toe"),
        parents=(-1, 0, 1, 2),
        offsets=np.array([[0, 0, 0], [0.1, -0.1, 0], [0, -0.4, 0.02], [0, -0.4, 0.1]], np.float32),
        robot=troupe.Robot("leg", hinges),
    )


def any_rotations(seed: int, *shape: int) -> np.ndarray:
    """Unit quaternions of any direction."""
    q = np.random.default_rng(seed).normal(size=(*shape, 4))
    return (q / np.linalg.norm(q, axis=-1, keepdims=True)).astype(np.float32)


def any_clip(skeleton: troupe.Skeleton, frames: int = 7, seed: int = 5) -> troupe.Clip:
    """A clip of any poses."""
    root = np.random.default_rng(seed).uniform(-2, 2, (frames, 3)).astype(np.float32)
    return troupe.Clip(skeleton, 30.0, root, any_rotations(seed, frames, skeleton.joint_count))
