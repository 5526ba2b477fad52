"""Checks that the Python servers solve the server's problems: same tokens, same contacts."""

import json
import urllib.request
from pathlib import Path

from troupe_bench import programs
from troupe_bench.programs import Failed, say
from troupe_bench.settings import Settings
from troupe_bench.store import Json

COMPARED = 8
CONTACT_TOLERANCE = {"cpu": 1e-3, "openvino-bf16": 2e-2}


def verify(settings: Settings) -> None:
    """Compares the answers to the first requests of the set, engine by engine.

    Raises Failed if they differ.
    """
    bodies = programs.requests(settings.pack, "64", settings.request_count)
    listed = json.loads((bodies / "requests.json").read_text())["requests"][:COMPARED]
    for engine in settings.engines:
        with programs.troupe(engine, settings.pack) as server:
            theirs = [_ask(server.url, bodies / entry["json"]) for entry in listed]
        ours = _solve_in_python(engine, settings.pack, bodies)
        pairs = list(zip(theirs, ours, strict=True))
        same = sum(a == b for their, our in pairs for a, b in zip(their["tokens"], our["tokens"], strict=True))
        tokens = sum(len(their["tokens"]) for their in theirs)
        gap = max(abs(a - b) for their, our in pairs for a, b in zip(their["contacts"], our["contacts"], strict=True))
        say(f"{engine}: {same} of {tokens} tokens are the same, contacts differ by at most {gap:.1e}")
        if same < 0.99 * tokens or gap > CONTACT_TOLERANCE[engine]:
            raise Failed(f"on {engine} the Python servers do not solve the server's problems")


def _ask(url: str, request: Path) -> Json:
    """Tokens and contacts of the server's answer."""
    body = json.loads(request.read_text())
    for character in body["characters"]:
        character["return_intermediates"] = True
    post = urllib.request.Request(
        url + "/v1/inbetween", json.dumps(body).encode(), {"content-type": "application/json"}
    )
    with urllib.request.urlopen(post, timeout=30) as answer:
        character = json.load(answer)["characters"][0]
    return {"tokens": character["intermediates"]["tokens"], "contacts": character["frames"]["contacts"]}


def _solve_in_python(engine: str, pack: Path, bodies: Path) -> list[Json]:
    """The same of the Python servers' code, in a process of its own with that engine's ONNX Runtime."""
    python, environment = programs.python_of(engine)
    arguments = ("--pack", pack, "--requests", bodies, "--engine", engine, "--count", str(COMPARED))
    printed = programs.call(python, "-m", "troupe_bench.solve", *arguments, env=environment)
    return json.loads(printed.splitlines()[-1])
