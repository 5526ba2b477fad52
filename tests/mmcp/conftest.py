"""A running Troupe server with real packs, and the protocol's own server for comparison."""

import os
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest
import uvicorn
from motionmcp import Backbone, ModelSpec, MotionResult, build_app
from motionmcp.client import get_capabilities
from other_side import Server


class Twin(Backbone):
    """One of our models on the protocol's own server: the same capabilities, and a motion at rest."""

    def __init__(self, spec: ModelSpec):
        self.model_id = spec.id
        self.spec = spec

    def capabilities(self) -> ModelSpec:
        return self.spec

    def generate(self, request) -> MotionResult:
        samples = request.options.num_samples if request.options else 1
        frames, joints = request.total_frames, len(request.skeleton.joints)
        rotations = np.zeros((samples, frames, joints, 4), dtype=np.float32)
        rotations[..., 3] = 1.0
        return MotionResult(rotations=rotations, root_translations=np.zeros((samples, frames, 3), np.float32))


@pytest.fixture(scope="session")
def ours() -> Server:
    url = os.environ.get("TROUPE_SERVER")
    if not url:
        pytest.skip("TROUPE_SERVER names no server: scripts/with-server.sh starts one")
    return Server(url, get_capabilities(url, use_cache=False))


@pytest.fixture(scope="session")
def theirs(ours: Server) -> Iterator[Server]:
    """The null server of the protocol, with the models of ours."""
    specs = [ModelSpec.model_validate(model) for model in ours.capabilities["models"]]
    config = uvicorn.Config(build_app([Twin(spec) for spec in specs]), host="127.0.0.1", port=0, log_level="error")
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run)
    thread.start()
    while not server.started:
        assert thread.is_alive(), "the null server does not start"
        time.sleep(0.02)
    port = server.servers[0].sockets[0].getsockname()[1]
    url = f"http://127.0.0.1:{port}"
    yield Server(url, get_capabilities(url, use_cache=False))
    server.should_exit = True
    thread.join()


@pytest.fixture(params=["human", "g1"])
def walker(request, ours: Server) -> dict:
    """A model that fills gaps between keyframes."""
    return ours.model(request.param)


@pytest.fixture(params=["unimogen/human", "unimogen/horse", "unimogen/snake"])
def follower(request, ours: Server) -> dict:
    """A model that follows paths."""
    return ours.model(request.param)


@pytest.fixture(params=["human", "g1", "unimogen/fox"])
def mover(request, ours: Server) -> dict:
    """Any model."""
    return ours.model(request.param)
