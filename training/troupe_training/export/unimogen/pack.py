"""``unimogen export``: a checkpoint -> a pack of one ONNX file, ``pack.toml`` and a file a body.

Rows, characters and frames are open axes: any mixture of bodies is one call, and nothing is padded to a largest skeleton. Weights
are stored in 16 bits. The file is compared with PyTorch on mixtures of several bodies and lengths before the pack is written.
"""

import copy
import hashlib
import json
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from torch import Tensor, nn

from troupe_training.data.bodies import DESCRIPTION, SLOTS, Body
from troupe_training.data.conventions import CONTEXT_FRAMES, MAX_TARGETS
from troupe_training.data.corpus import CorpusClip
from troupe_training.export.bodies import write_body
from troupe_training.export.manifest import About, Family, write_manifest
from troupe_training.export.onnx import Axes, Session, graph_of, largest_of, round_to_half, store_as_half
from troupe_training.models.unimogen.config import DIFFUSION_STEPS, RATE, SAMPLER_STEPS
from troupe_training.models.unimogen.diffusion import cosine_signal
from troupe_training.models.unimogen.network import UniMoGen
from troupe_training.models.unimogen.sampler import INPUTS, Arrays, Batch, Character, Denoiser
from troupe_training.models.unimogen.state import BEND_GAIN, MAX_TURN, Range
from troupe_training.train.plots import plot_curves
from troupe_training.train.unimogen.stage import STAGE, Trained, load

FAMILY = Family("unimogen", ("live", "path"))
FILE = "denoiser.onnx"
OPSET = 20
LICENCES = ("CC0 1.0", "CC BY 4.0", "CC BY-NC 4.0", "CC BY-NC-ND 4.0")  # of motion, the strictest last
METHOD = "UniMoGen (Khani et al. 2025) for the method"
TOLERANCE = 1e-3
MIN_TOKENS, MAX_TOKENS = 5, 17  # of four frames: what training windows have, past and all
CHECKED = (((0,), 20), ((0, 1), 36), ((2, 0, 1, 0), 68), ((1, 1, 2), 64))  # bodies by their place, and frames


def export_run(run: Path, cache: Path, out: Path, about: About) -> None:
    """A run's checkpoint as a pack, with the bodies that it was trained on, and its loss curve."""
    trained = load(run)
    bodies = {name: Body.load(cache / name / "body.json") for name in trained.bodies}
    seen = {name: _seen(cache / name) for name in bodies}
    state = trained.state
    training: dict[str, Any] = {
        "clips": sum(clips for clips, _, _ in seen.values()),
        "frames": sum(frames for _, frames, _ in seen.values()),
        "unimogen_steps": state["step"],
        "unimogen_minutes": round(state["seconds"] / 60, 1),
    }
    if state["history"]:
        training["unimogen_final_loss"] = state["history"][-1]["total"]
    words = {name: words for name, (_, _, words) in seen.items()}
    licence, credits = _terms(cache, list(bodies))
    licence = licence if about.licence == "unknown" else about.licence
    full = replace(about, training=training, licence=licence, credits=about.credits or credits)
    export_pack(out, full, trained, bodies, words)
    plot_curves(run, [STAGE], out / "curves.png")


def _terms(cache: Path, bodies: list[str]) -> tuple[str, list[str]]:
    """The strictest licence of the bodies' motion, and whom to credit."""
    options = [json.loads((cache / name / "clips.json").read_text())["options"] for name in bodies]
    licences = {one["licence"] for one in options}
    known = licences <= set(LICENCES)
    credits = list(dict.fromkeys(credit for one in options for credit in one["credits"]))
    return max(licences, key=LICENCES.index) if known else "unknown", [*credits, METHOD]


def _seen(folder: Path) -> tuple[int, int, list[str]]:
    """Clips, frames and words of a body's training split."""
    clips: list[CorpusClip] = json.loads((folder / "clips.json").read_text())["clips"]
    clips = [c for c in clips if c["split"] == "train"]
    return len(clips), sum(c["frames"] for c in clips), sorted({word for c in clips for word in c["words"]})


def export_pack(
    out: Path, about: About, trained: Trained, bodies: dict[str, Body], words: dict[str, list[str]]
) -> None:
    """Writes the pack folder and fails if the file differs from PyTorch by more than `TOLERANCE`.

    The first of ``bodies`` that is a biped without hinges, or else the first, is the manifest's own skeleton.
    """
    fresh = out.with_name(out.name + ".new")
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(parents=True)
    several = list(bodies.values())
    model, difference = write_checked(trained.model, fresh / FILE, several)
    digest = hashlib.sha256((fresh / FILE).read_bytes()).hexdigest()
    sizes = {
        "frames_per_token": RATE,
        "min_tokens": MIN_TOKENS,
        "max_tokens": MAX_TOKENS,
        "context_frames": CONTEXT_FRAMES,
        "max_targets": MAX_TARGETS,
        "parameters": sum(p.numel() for p in model.parameters()),
    }
    main = bodies.get("human", several[0])
    write_manifest(fresh, FAMILY, about, sizes, digest, main.skeleton, {"denoiser": difference})
    with (fresh / "pack.toml").open("a", encoding="utf-8") as file:
        file.write("\n".join(_family_lines(trained.words, list(bodies), main.name, trained.limits)) + "\n")
    for name, body in bodies.items():
        write_body(fresh, body, words.get(name, []), "troupe-train unimogen export")
    shutil.rmtree(out / "bodies", ignore_errors=True)
    out.mkdir(parents=True, exist_ok=True)
    for path in fresh.iterdir():  # only a pack that passed replaces the one before
        path.replace(out / path.name)
    fresh.rmdir()


def _family_lines(words: list[str], bodies: list[str], main: str, limits: Range) -> list[str]:
    """Lines for the family's runner, besides the graph."""
    rounded = {
        name: [round(float(v), 6) for v in values] for name, values in (("low", limits.low), ("high", limits.high))
    }
    return [
        "",
        "# How rows, paths and noise are made: training/troupe_training/models/unimogen (state.py, diffusion.py, sampler.py).",
        "[unimogen]",
        f"bodies = {json.dumps(bodies)}",
        f"default_body = {json.dumps(main)}",
        f"words = {json.dumps(words)}",
        f"description = {json.dumps(DESCRIPTION)}",
        f"slots = {SLOTS}",
        f"diffusion_steps = {DIFFUSION_STEPS}",
        f"sampler_steps = {SAMPLER_STEPS}",
        f"signal = {json.dumps([float(v) for v in cosine_signal()])}",
        f"root_low = {json.dumps(rounded['low'])}",
        f"root_high = {json.dumps(rounded['high'])}",
        f"bend_gain = {BEND_GAIN}",
        f"max_turn_rad_per_s = {MAX_TURN}",
    ]


def example(model: UniMoGen, bodies: Sequence[Body], which: Sequence[int], frames: int, seed: int) -> dict[str, Tensor]:
    """Inputs of some characters at a random state."""
    rng = np.random.default_rng(seed)
    characters = []
    for nth, index in enumerate(which):
        body = bodies[index % len(bodies)]
        given = (np.arange(frames) < CONTEXT_FRAMES).astype(np.float32) if nth % 2 else None
        known = 0.1 * rng.standard_normal((body.joint_count + 1, frames, 6)).astype(np.float32)
        style = (rng.random(model.words) < 0.1).astype(np.float32)
        path = rng.standard_normal((frames, 3)).astype(np.float32)
        characters.append(Character(body, path, style, seed + nth, given, known))
    batch = Batch(characters)
    steps = rng.integers(0, DIFFUSION_STEPS, len(characters)).astype(np.float32)
    arrays: Arrays = batch.constant | {"x": np.concatenate(batch.state), "step": steps}
    return {name: torch.from_numpy(np.ascontiguousarray(arrays[name])) for name in INPUTS}


def write_checked(trained: UniMoGen, path: Path, bodies: Sequence[Body]) -> tuple[UniMoGen, float]:
    """Writes the ONNX file, in 16 bits; returns the network as written and the file's largest difference from it.

    Removes the file and ends the command if that is more than `TOLERANCE`.
    """
    model = copy.deepcopy(trained).eval().requires_grad_(False)
    round_to_half(model)
    write_network(model, path, example(model, bodies, (0, len(bodies) - 1, 0), 36, seed=1))
    difference = check_network(model, path, bodies)
    print(f"{path.name}: {path.stat().st_size / 1e6:.1f} MB, differs from PyTorch by at most {difference:.1e}")
    if difference > TOLERANCE:
        path.unlink()
        raise SystemExit(f"{path.name} differs from PyTorch by {difference:.1e}, at most {TOLERANCE} is allowed")
    return model, difference


def write_network(model: nn.Module, path: Path, inputs: dict[str, Tensor]) -> None:
    """Writes the ONNX file with rows, characters and frames open."""
    rows, characters = torch.export.Dim("rows", min=2, max=65536), torch.export.Dim("characters", min=1, max=4096)
    frames = RATE * torch.export.Dim("tokens", min=2, max=256)
    axes: dict[str, Axes] = {
        "x": {0: rows, 1: frames},
        "given": {0: characters, 1: frames},
        "path": {0: characters, 1: frames},
        "step": {0: characters},
        "style": {0: characters},
    }
    graph = graph_of(model, inputs, ["clean"], [axes.get(name, {0: rows}) for name in inputs], OPSET)
    store_as_half(graph)
    graph.doc_string = "Troupe UniMoGen denoiser"
    onnx.checker.check_model(graph)
    onnx.save(graph, path)


def check_network(model: UniMoGen, path: Path, bodies: Sequence[Body]) -> float:
    """The largest difference between ONNX Runtime and PyTorch over mixtures of bodies and lengths."""
    session, worst = Session(path), 0.0
    for seed, (which, frames) in enumerate(CHECKED):
        inputs = example(model, bodies, which, frames, seed + 7)
        with torch.no_grad():
            expected = model(*inputs.values())
        worst = max(worst, largest_of(session.run(inputs)["clean"] - expected))
    return worst


def denoiser_of(path: Path, threads: int = 1) -> Denoiser:
    """A pack's network at work in ONNX Runtime."""
    session = Session(path, threads)

    def run(arrays: Arrays) -> np.ndarray:
        inputs = {name: torch.from_numpy(np.ascontiguousarray(arrays[name])) for name in INPUTS}
        clean: np.ndarray = session.run(inputs)["clean"].numpy()
        return clean

    return run


def network_of(model: UniMoGen) -> Denoiser:
    """A network at work in PyTorch."""

    def run(arrays: Arrays) -> np.ndarray:
        inputs = (torch.from_numpy(np.ascontiguousarray(arrays[name])) for name in INPUTS)
        with torch.no_grad():
            clean: np.ndarray = model(*inputs).numpy()
        return clean

    return run
