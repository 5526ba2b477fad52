"""Motion of words, by Troupe and by FastAPI over the same graphs: they agree, FastAPI is tuned, then they take turns."""

import contextlib
import http.client
import json
import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from troupe_bench import programs
from troupe_bench.body import read_frames
from troupe_bench.machine import cores, cpu_seconds
from troupe_bench.programs import Failed, say
from troupe_bench.settings import Settings, python_settings
from troupe_bench.store import Json, Store
from troupe_bench.words_load import TIMEOUT_S, Target, Troupe, Words, load, words

TARGETS = ("troupe", "fastapi", "fastapi-whole")
"""`fastapi` gives frames in parts, as Troupe does; `fastapi-whole` decodes a motion once, at its end."""
CHECKS: dict[str, float | None] = {"greedy": 0.0, "drawn": None}
"""Temperatures at which both servers are to give the same motion; None is the pack's own."""
COMPARED = 100
NEAR_M = 1e-3
LEAST_SHARE = 0.99
TUNED_CLIENTS = 32


def measure(settings: Settings) -> None:
    """Checks, tunes, and measures every target at each number of clients, in turns."""
    store = Store(settings.results, "words")
    for name, temperature in CHECKS.items():
        if not store.of({"check": name}):
            compared = COMPARED // 5 if settings.quick else COMPARED
            store.add({"check": name}, agreement(settings.words_pack, name, temperature, compared))
    tune(settings, store)
    options = best_options(store)
    for repeat in range(settings.repeats):
        # Each turn begins with another target, so that none is always behind the same one.
        for target in (*TARGETS[repeat % len(TARGETS) :], *TARGETS[: repeat % len(TARGETS)]):
            turn: Json = {"target": target, "repeat": repeat}
            counts = [clients for clients in settings.words_clients if not store.of(turn | {"clients": clients})]
            if not counts:
                continue
            with served(target, settings.words_pack, options) as (server, asked):
                for clients in counts:
                    key = turn | {"clients": clients}
                    store.add(key, _loaded(server, asked, clients, settings.warmup_s, settings.measured_s))
                    say(f"{key}: {_summary(store.of(key)[0])}")


@contextlib.contextmanager
def served(target: str, pack: Path, settings: Json) -> Iterator[tuple[programs.Running, Target]]:
    """A target that runs: Troupe with as many threads for its networks as there are cores, FastAPI with `settings`."""
    if target == "troupe":
        # FastAPI lets requests wait as long as they have to, so Troupe is to do the same.
        patience = ("--max-queue-ms", "0", "--request-timeout-ms", str(1000 * TIMEOUT_S))
        threads = ("--threads", str(max(1, int(cores()))))
        with programs.troupe("cpu", pack, *threads, *patience, "--store", "") as server:
            yield server, Troupe(server.url, tomllib.loads((pack / "pack.toml").read_text())["name"])
        return
    whole = {"whole": True} if target == "fastapi-whole" else {}
    with programs.words_server(pack, settings | whole) as server:
        yield server, Target(server.url)


def tune(settings: Settings, store: Store) -> None:
    """Tries settings of the FastAPI server and keeps what each one reached."""
    for options in python_settings("words", settings.quick):
        key = {"target": "fastapi", "options": options}
        if store.of(key):
            continue
        try:
            with served("fastapi", settings.words_pack, options) as (server, asked):
                store.add(key, _loaded(server, asked, TUNED_CLIENTS, settings.warmup_s, settings.tune_s))
        except Failed as error:
            say(f"FastAPI {options}: {error}")
            continue
        say(f"FastAPI {options}: {_summary(store.of(key)[0])}")


def best_options(store: Store) -> Json:
    """The options of the FastAPI server that were the fastest."""
    tried = [key for key in store.every_key() if "options" in key]
    if not tried:
        raise Failed("no settings of the FastAPI server ran")
    best: Json = max(tried, key=lambda key: store.median(key, "frames_per_s") or 0.0)["options"]
    return best


def _loaded(server: programs.Running, asked: Target, clients: int, warmup_s: float, measured_s: float) -> Json:
    """A run in which nothing failed."""
    before = cpu_seconds(server.pid)
    run = load(asked, clients, warmup_s, measured_s)
    if run["failed"]:
        raise Failed(f"{run['failed']} requests to {server.name} failed: {run['examples']}")
    # A busy machine changes this less than it changes what came in the time.
    return run | {"frames_per_cpu_s": run["frames"] / (cpu_seconds(server.pid) - before)}


def _summary(run: Json) -> str:
    first, whole = run["first_frames_ms"].get("p50", 0.0), run["answer_ms"].get("p50", 0.0)
    return f"{run['frames_per_s'] / 4:,.0f} tokens/s, first frames after {first:.0f} ms, all after {whole:.0f} ms"


def agreement(pack: Path, name: str, temperature: float | None, count: int) -> Json:
    """Asks both servers the same: how many motions are the same, and how far apart joints of those are.

    Raises Failed if fewer than 99 of 100 are.
    """
    asked = [words(index) for index in range(count)]
    skeleton = Skeleton(pack)
    with served("troupe", pack, {}) as (_, target):
        theirs = [skeleton.of_troupe(answer(target, one, temperature)) for one in asked]
    with served("fastapi", pack, python_settings("words", True)[0]) as (_, target):
        ours = [skeleton.of_python(answer(target, one, temperature)) for one in asked]
    gaps = [gap(a, b, one) for a, b, one in zip(theirs, ours, asked, strict=True)]
    same = [found for found in gaps if found <= NEAR_M]
    say(f"{name}: {len(same)} of {count} motions are the same; joints of those differ by {max(same, default=0):.1e} m")
    if len(same) < LEAST_SHARE * count:
        raise Failed(f"only {len(same)} of {count} motions of the Python server are those of the server")
    return {"compared": count, "same": len(same), "largest_m": max(same)}


def answer(target: Target, asked: Words, temperature: float | None) -> list[tuple[int, bytes]]:
    """All parts of an answer.

    Raises Failed if the server gives none.
    """
    try:
        return list(target.ask(asked, temperature))
    except (OSError, ValueError, http.client.HTTPException) as error:
        raise Failed(f"{asked}: {error}") from error


def gap(theirs: np.ndarray, ours: np.ndarray, asked: Words) -> float:
    """The largest distance of a joint between two motions ``[F, J, 3]``.

    Raises Failed if they have other frames than requested, or are not finite.
    """
    if theirs.shape != ours.shape or len(ours) != asked.frames:
        raise Failed(f"{asked}: {theirs.shape} and {ours.shape} joints came")
    if not (np.isfinite(theirs).all() and np.isfinite(ours).all()):
        raise Failed(f"{asked}: numbers that are not finite came")
    return float(np.linalg.norm(theirs - ours, axis=-1).max())


class Skeleton:
    """A pack's body: what both servers say, as joint positions ``[F, J, 3]`` in metres."""

    def __init__(self, pack: Path):
        joints = tomllib.loads((pack / "pack.toml").read_text())["skeleton"]["joints"]
        names = [joint["name"] for joint in joints]
        self.parents = [names.index(joint["parent"]) if joint["parent"] else -1 for joint in joints]
        self.offsets = np.array([joint["offset_m"] for joint in joints])

    def of_troupe(self, parts: list[tuple[int, bytes]]) -> np.ndarray:
        """Of JSON lines, whose rotations are quaternions relative to parents."""
        frames = [json.loads(line)["frames"] for _, line in parts]
        root = np.concatenate([np.array(part["root_positions"]).reshape(-1, 3) for part in frames])
        quats = np.concatenate([np.array(part["rotations"]).reshape(-1, len(self.parents), 4) for part in frames])
        turned = matrices(quats)
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                turned[:, joint] = turned[:, parent] @ turned[:, joint]
        return self.joints(root, turned)

    def of_python(self, parts: list[tuple[int, bytes]]) -> np.ndarray:
        """Of the FastAPI server's parts."""
        read = [read_frames(body, frames) for frames, body in parts]
        root = np.concatenate([root for root, _ in read]).astype(float)
        columns = np.concatenate([turned for _, turned in read]).reshape(len(root), -1, 2, 3).astype(float)
        x, y = columns[..., 0, :], columns[..., 1, :]
        return self.joints(root[:, :3], np.stack([x, y, np.cross(x, y)], -1))

    def joints(self, root: np.ndarray, turned: np.ndarray) -> np.ndarray:
        """Joints of root positions ``[F, 3]`` and world rotations ``[F, J, 3, 3]``."""
        places = np.empty(turned.shape[:3])
        for joint, parent in enumerate(self.parents):
            places[:, joint] = root if parent < 0 else places[:, parent] + turned[:, parent] @ self.offsets[joint]
        return places


def matrices(quats: np.ndarray) -> np.ndarray:
    """Rotations ``[..., 3, 3]`` of unit quaternions ``[..., 4]``: w, x, y, z."""
    w, x, y, z = np.moveaxis(quats, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, -1) for row in rows], -2)
