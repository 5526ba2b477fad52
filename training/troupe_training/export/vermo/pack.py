"""``vermo export``: checkpoints -> a pack of ONNX files, text pieces, the words of the training's captions and ``pack.toml``."""

import hashlib
import json
import shutil
from dataclasses import dataclass
from pathlib import Path

from troupe_training.data.captions import style_phrases
from troupe_training.data.skeleton import Skeleton
from troupe_training.export.manifest import About, Family, write_manifest
from troupe_training.export.vermo.graphs import FILES, Networks, shipped, write_graphs
from troupe_training.models.vermo.config import FLOW_STEPS, MIN_TOKENS, RATE
from troupe_training.models.vermo.pieces import Pieces
from troupe_training.models.vermo.sampler import Sampling

CONTEXT_FRAMES = 16  # past frames that go into a message at least
MAX_PROMPT_PIECES = 40
TOLERANCE = 2e-3
# By default. Colder texts are followed better, and warmer motions are more like captures as a set.
# Guidance: docs/words.md#content-and-style has the figures.
SAMPLING = Sampling(0.7, 0, 0.9, 1.1, content_guidance=2.0, style_guidance=3.0)
MOST_OTHER_TOKENS = 0.02  # share of tokens that ONNX Runtime may give otherwise


@dataclass
class Served:
    """The capabilities of a pack."""

    tasks: list[str]
    pieces: Pieces
    words: list[str]
    max_agents: int = 1
    sampling: Sampling = SAMPLING


def export_pack(out: Path, about: About, skeleton: Skeleton, networks: Networks, served: Served) -> Networks:
    """Writes the pack folder and gives the networks as they are shipped; fails if a file differs too much from PyTorch."""
    fresh = out.with_name(out.name + ".new")
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(parents=True)
    networks = shipped(networks)
    checks = write_graphs(networks, fresh)
    for name, difference in checks.items():
        size = (fresh / f"{name}.onnx").stat().st_size / 1e6
        print(f"{name}.onnx: {size:.1f} MB, differs from PyTorch by at most {difference:.1e}", flush=True)
        if difference > (MOST_OTHER_TOKENS if name == "encoder" else TOLERANCE):
            raise SystemExit(f"{name}.onnx differs from PyTorch by {difference:.1e}, which is too much")
    served.pieces.save(fresh / "tokenizer.json")
    (fresh / "words.txt").write_text("".join(word + "\n" for word in served.words), encoding="utf-8")
    if _is_guided(served.sampling):
        (fresh / "styles.txt").write_text("".join(phrase + "\n" for phrase in style_phrases()), encoding="utf-8")
    digest = hashlib.sha256()
    for name in FILES:
        if name in checks:
            digest.update((fresh / f"{name}.onnx").read_bytes())
    digest.update((fresh / "tokenizer.json").read_bytes())
    sizes = {
        "frames_per_token": RATE,
        "min_tokens": MIN_TOKENS,
        "max_tokens": networks.language.vocabulary.max_tokens,
        "context_frames": CONTEXT_FRAMES,
        "parameters": networks.parameters(),
    }
    abilities = ("text", "describe", *(["agents"] if served.max_agents > 1 else []))
    write_manifest(fresh, Family("vermo", abilities), about, sizes, digest.hexdigest(), skeleton, checks)
    with (fresh / "pack.toml").open("a", encoding="utf-8") as file:
        file.write("\n".join(_family_lines(networks, served)) + "\n")
    shutil.rmtree(out, ignore_errors=True)
    fresh.rename(out)
    return networks


def _family_lines(networks: Networks, served: Served) -> list[str]:
    """Lines for the family's runner, besides the graphs."""
    config, vocabulary, sampling = networks.language.config, networks.language.vocabulary, served.sampling
    return [
        "",
        "# How messages are written: training/troupe_training/models/vermo/messages.py.",
        "[vermo]",
        f"layers = {config.layers}",
        f"key_heads = {config.key_heads}",
        f"head_width = {config.head_width}",
        f"positions = {config.positions}",
        f"text_pieces = {vocabulary.text_pieces}",
        f"motion_codes = {vocabulary.motion_codes}",
        f"audio_codes = {vocabulary.audio_codes}",
        f"tasks = {json.dumps(served.tasks)}",
        f"max_prompt_pieces = {MAX_PROMPT_PIECES}",
        f"max_agents = {served.max_agents}",
        f"flow_steps = {FLOW_STEPS if networks.flow is not None else 0}",
        f"temperature = {sampling.temperature}",
        f"top_k = {sampling.top_k}",
        f"top_p = {sampling.top_p}",
        f"repetition = {sampling.repetition}",
        *(
            [f"content_guidance = {sampling.content_guidance}", f"style_guidance = {sampling.style_guidance}"]
            if _is_guided(sampling)
            else []
        ),
    ]


def _is_guided(sampling: Sampling) -> bool:
    return (sampling.content_guidance, sampling.style_guidance) != (1.0, 1.0)
