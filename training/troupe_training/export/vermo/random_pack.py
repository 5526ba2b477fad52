"""``vermo random-pack``: a small pack of random weights for tests of a server. Its motion and text mean nothing.

It has audio codes and all tasks, which no pack that is trained here has. `reference` writes what PyTorch answers to some
messages, without a cache.
"""

import json
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from troupe_training.data.captions import CONTENTS, STYLES, plain_captions
from troupe_training.data.skeleton import Skeleton
from troupe_training.export.manifest import About, read_manifest
from troupe_training.export.vermo.graphs import Networks, random_motion
from troupe_training.export.vermo.pack import Served, export_pack
from troupe_training.models.vermo.config import MAX_TOKENS, MIN_TOKENS, PRESETS
from troupe_training.models.vermo.flow import FlowDecoder
from troupe_training.models.vermo.language import LanguageModel
from troupe_training.models.vermo.messages import EOS, TASKS, Message, Rules, Vocabulary
from troupe_training.models.vermo.pieces import Pieces, train_pieces, words_of
from troupe_training.models.vermo.sampler import Sampling
from troupe_training.models.vermo.tokenizer import Tokenizer

AUDIO_CODES = 64
PIECES = 160  # few, so that the file is small and words are often of several
SPREAD = 0.1  # deviation of decoded states about the identity
LOUD = (
    10.0  # by which random tables are larger than those that training begins with: near-equal logits would be a lottery
)
REPLY = 6  # tokens of a reference reply at most
WITH_LOGITS = (2, 3)  # messages of the reference that have them: two agents, and a reply in words
DIGITS = 5  # that numbers of the reference are rounded to


def random_networks(preset: str, skeleton: Skeleton, text_pieces: int) -> Networks:
    """Untrained networks whose rotations come out near the identity, and whose codes and logits differ."""
    sizes = PRESETS[preset]
    tokenizer = Tokenizer(sizes.tokenizer, skeleton)
    body = tokenizer.body
    upright = torch.tensor([1.0, 0, 0, 0, 1, 0]).repeat(body.joints)
    mean = torch.cat([upright, torch.tensor([0.0, 1.0, 0.0, 0.9])])
    tokenizer.state_scale.set(mean, torch.full_like(mean, SPREAD))
    vocabulary = Vocabulary(text_pieces, sizes.tokenizer.codes, AUDIO_CODES, MAX_TOKENS)
    language = LanguageModel(sizes.language, vocabulary, sizes.tokenizer.levels)
    flow = FlowDecoder(sizes.flow, len(sizes.tokenizer.levels), body.state_width)
    with torch.no_grad():
        tokenizer.encoder.leave.weight.mul_(3 * LOUD)
        language.own.mul_(LOUD)
        language.shared.mul_(LOUD)
        for weight in language.layers.parameters():
            if weight.dim() == 2:
                weight.mul_(LOUD)
        flow.leave.weight.normal_(std=0.05)
    return Networks(tokenizer.eval(), language.eval(), flow.eval())


def random_pack(out: Path, like: Path, preset: str, seed: int) -> tuple[Networks, Pieces]:
    """Writes the pack folder; networks and pieces as they are shipped."""
    torch.manual_seed(seed)
    skeleton = Skeleton.of_manifest(read_manifest(like))
    captions = [text for content in CONTENTS for style in STYLES for text in plain_captions(content, style)]
    pieces = Pieces(train_pieces(captions, PIECES))
    networks = random_networks(preset, skeleton, pieces.count)
    about = About(
        out.resolve().name,
        "0.0.0",
        "Apache-2.0",
        ["random weights, for tests only: motion and text mean nothing"],
        {"preset": preset, "random_weights_seed": seed},
    )
    served = Served(list(TASKS), pieces, words_of(captions), max_agents=3, sampling=Sampling(0.7, 0, 0.9, 1.1))
    return export_pack(out, about, skeleton, networks, served), pieces


def reference(networks: Networks, pieces: Pieces) -> dict[str, Any]:
    """Messages with their ids and greedy replies, uncached; of some the logits after the prompt; codes and frames of a motion."""
    motion = random_motion(networks.tokenizer.body, 1, 4, seed=5)
    tokens = networks.tokenizer.encode(**motion)
    pose, root = networks.tokenizer.decode(tokens)
    codes: list[int] = tokens[0].tolist()
    text, other = "An angry person walks, slowly!", "someone waves the left hand"
    asked = [
        (Message("text_to_motion", [pieces.ids(text)]), 1, text),
        (Message("text_to_motion", [pieces.ids(text)], [[codes]], length=4), 1, text),
        (Message("text_to_motion", [pieces.ids(text), pieces.ids(other)], length=2), 2, f"{text} / {other}"),
        (Message("motion_to_text", condition=[[codes]]), 1, ""),
        (Message("prediction", condition=[[codes]]), 1, ""),
        (Message("inbetween", condition=[[codes[:2], codes[2:]]], length=3), 1, ""),
        (Message("inbetween", condition=[[codes[:1], codes[1:2]], [codes[2:3], codes[3:]]], length=2), 2, ""),
        (Message("unconditional"), 1, ""),
        (Message("music_to_dance", condition=[[[1, 5, 9]]]), 1, ""),
        (Message("dance_to_music", condition=[[codes]]), 1, ""),
    ]
    answers = [_answered(networks.language, pieces, *one) for one in asked]
    for number, answer in enumerate(answers):
        if number not in WITH_LOGITS:
            del answer["logits"]
    return {
        "messages": answers,
        "encoder": {name: _rounded(values) for name, values in motion.items()} | {"tokens": tokens.tolist()},
        "decoder": {"tokens": tokens.tolist(), "pose": _rounded(pose), "root": _rounded(root)},
    }


def _rounded(values: Tensor) -> list[Any]:
    shape = values.shape
    flat = [round(value, DIGITS) for value in values.flatten().tolist()]
    for size in reversed(shape[1:]):
        flat = [flat[n : n + size] for n in range(0, len(flat), size)]
    return flat


@torch.no_grad()
def _answered(language: LanguageModel, pieces: Pieces, message: Message, agents: int, text: str) -> dict[str, Any]:
    vocabulary = language.vocabulary
    prompt = message.prompt(vocabulary)
    rules = Rules(message.task, MIN_TOKENS, REPLY, language.config.positions, agents, message.length)
    ids: list[int] = []
    first: Tensor | None = None
    while not ids or ids[-1] != EOS:
        logits = language(torch.tensor([prompt + ids]))[0, -1]
        first = logits if first is None else first
        allowed = rules.allowed(vocabulary, len(prompt), ids)
        ids.append(int(logits.masked_fill(~allowed, float("-inf")).argmax()))
        if rules.kind != "motion" and len(ids) >= REPLY:
            break
    assert first is not None
    length = {} if message.length is None else {"length": message.length}
    return {
        "task": message.task,
        "text": text,
        **length,
        "agents": agents,
        "prompt": prompt,
        "logits": _rounded(first),
        "reply": ids,
        "max_tokens": REPLY,
    }


def write_reference(path: Path, networks: Networks, pieces: Pieces) -> None:
    """Writes `reference` as JSON, a message a line."""
    expected = reference(networks, pieces)
    lines = {name: json.dumps(expected[name], separators=(",", ":")) for name in ("encoder", "decoder")}
    messages = ",\n".join(json.dumps(message, separators=(",", ":")) for message in expected["messages"])
    rest = ",\n".join(f'"{name}": {text}' for name, text in lines.items())
    path.write_text(f'{{\n"messages": [\n{messages}\n],\n{rest}\n}}\n')
