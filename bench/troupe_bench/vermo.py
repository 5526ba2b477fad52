"""A VerMo pack in Python, one sequence at a time: words to tokens to frames, with numpy and ONNX Runtime.

`docs/vermo-pack.md` says how messages are written and what the graphs read. Motion leaves in parts, as a Troupe server gives it:
4 tokens, then 8 at a time. Each is decoded with the 4 tokens before it, and 2 are held back while more may come.
"""

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tokenizers import Tokenizer

from troupe_bench.stages import open_session

BOS, EOS, INSTRUCTION, REPLY = 1, 2, 3, 5
TEXT_TO_MOTION, SPECIALS = 8, 18
HELD_BACK, LEAD, FIRST_PART, LATER_PART = 2, 4, 4, 8
RECENT = 8  # tokens that repetition looks back at
GOLDEN, MASK = 0x9E3779B97F4A7C15, 2**64 - 1
NUCLEUS = 256  # likeliest tokens that are looked at first: most often they are all that may be drawn


@dataclass(frozen=True)
class Sampling:
    """How tokens are chosen: `temperature` 0 takes the likeliest, `top_k` 0 and `top_p` 1 leave all."""

    temperature: float
    top_k: int
    top_p: float
    repetition: float


@dataclass(frozen=True)
class Asked:
    """Words, and how many frames to make of them."""

    text: str
    frames: int
    seed: int
    sampling: Sampling


@dataclass
class Part:
    """Frames of a motion: roots ``[F, 5]`` (place in metres, cosine and sine of the heading), world rotations ``[F, 6 J]``."""

    root: np.ndarray
    rotations: np.ndarray

    def __len__(self) -> int:
        return len(self.root)


def step64(base: int, index: int) -> int:
    """A random number of 64 bits for a base and an index, as a Troupe server has them (splitmix64)."""
    bits = (base + GOLDEN * (index + 1)) & MASK
    bits = ((bits ^ (bits >> 30)) * 0xBF58476D1CE4E5B9) & MASK
    bits = ((bits ^ (bits >> 27)) * 0x94D049BB133111EB) & MASK
    return bits ^ (bits >> 31)


def choose(logits: np.ndarray, recent: np.ndarray, sampling: Sampling, unit: float) -> int:
    """The next code from the logits ``[codes]``, where codes of `recent` are weakened. `unit` in [0, 1) decides the draw."""
    if sampling.repetition != 1.0 and len(recent):
        logits = logits.copy()
        seen = np.unique(recent)
        weak = logits[seen]
        logits[seen] = np.where(weak > 0, weak / sampling.repetition, weak * sampling.repetition)
    if sampling.temperature == 0.0:
        return int(logits.argmax())
    weights = np.exp(((logits - logits.max()) / np.float32(sampling.temperature)).astype(np.float64))
    total = weights.sum()
    count = sampling.top_k or len(weights)
    if sampling.top_k and count < len(weights):
        total = np.partition(weights, -count)[-count:].sum()
    order = likeliest(weights, min(NUCLEUS, count))
    sums = weights[order].cumsum()
    if len(order) < count and sums[-1] < sampling.top_p * total:
        order = likeliest(weights, count)
        sums = weights[order].cumsum()
    kept = min(int(np.searchsorted(sums, sampling.top_p * total)) + 1, len(order))
    return int(order[min(int(np.searchsorted(sums[:kept], unit * sums[kept - 1], "right")), kept - 1)])


def likeliest(weights: np.ndarray, count: int) -> np.ndarray:
    """The indices of the largest weights, the largest first."""
    found = np.argpartition(weights, -count)[-count:] if count < len(weights) else np.arange(len(weights))
    return found[np.argsort(-weights[found], kind="stable")]


class VerMo:
    """A pack's networks. Calls from several threads are fine: each has a cache of its own."""

    def __init__(self, pack: Path, threads: int = 1, spin: bool = True, cache_unit: int = 16):
        """``cache_unit``: the language model reads as many columns of the cache as are filled, rounded up to this."""
        manifest = tomllib.loads((pack / "pack.toml").read_text())
        table = manifest["vermo"]
        self.per_token, self.most = manifest["frames_per_token"], manifest["max_tokens"]
        self.least = manifest["min_tokens"]
        self.joints = len(manifest["skeleton"]["joints"])
        self.positions, self.max_pieces = table["positions"], table["max_prompt_pieces"]
        self.first_text = SPECIALS + self.most
        first = self.first_text + table["text_pieces"]
        self.codes = slice(first, first + table["motion_codes"])
        self.shape = (1, table["layers"], 2, table["key_heads"], self.positions, table["head_width"])
        names = ("temperature", "top_k", "top_p", "repetition")
        self.sampling = Sampling(*(table[name] for name in names))
        self.cache_unit = cache_unit
        self.pieces = Tokenizer.from_file(str(pack / "tokenizer.json"))
        self.language, self.decoder = (
            open_session(pack / f"{name}.onnx", "cpu", threads, spin) for name in ("language", "decoder")
        )

    def warm_up(self) -> None:
        """Runs the shapes that come, because the first run of a shape is slow."""
        for frames in (self.per_token * self.least, self.per_token * self.most):
            for _ in self.parts(Asked("a person walks", frames, 1, self.sampling)):
                pass

    def prompt(self, text: str, tokens: int) -> list[int]:
        """The message up to its reply of so many tokens.

        Raises ValueError if the pack does not take it.
        """
        pieces = self.pieces.encode(text, add_special_tokens=False).ids
        if not 1 <= len(pieces) <= self.max_pieces:
            raise ValueError(f"text: is {len(pieces)} pieces long; allowed: 1 to {self.max_pieces}")
        if not self.least <= tokens <= self.most or len(pieces) + tokens + 6 > self.positions:
            raise ValueError(f"frames: make {tokens} tokens; allowed: {self.least} to {self.most}")
        words = [self.first_text + piece for piece in pieces]
        return [BOS, TEXT_TO_MOTION, INSTRUCTION, *words, SPECIALS + tokens - 1, REPLY]

    def tokens(self, asked: Asked) -> Iterator[int]:
        """Codes of the reply, one by one."""
        wanted = -(-asked.frames // self.per_token)
        key = step64(asked.seed, 0)
        cache = np.zeros(self.shape, np.float32)
        fresh, start = self.prompt(asked.text, wanted), 0
        made = np.empty(wanted, np.int64)
        for place in range(wanted):
            logits = self._read(cache, fresh, start)[self.codes]
            start += len(fresh)
            made[place] = choose(
                logits, made[max(0, place - RECENT) : place], asked.sampling, (step64(key, place) >> 11) / 2**53
            )
            fresh = [self.codes.start + int(made[place])]
            yield int(made[place])

    def _read(self, cache: np.ndarray, tokens: list[int], start: int) -> np.ndarray:
        """Logits ``[V]`` after tokens that follow `start` columns of the cache, which takes theirs."""
        known = max(1, min(-(-start // self.cache_unit) * self.cache_unit, self.positions))
        inputs = {
            "tokens": np.array([tokens], np.int64),
            "count": np.array([len(tokens)], np.int64),
            "start": np.array([start], np.int64),
            "cache": cache if known == self.positions else np.ascontiguousarray(cache[..., :known, :]),
        }
        logits, columns = self.language.run(["logits", "columns"], inputs)
        cache[..., start : start + len(tokens), :] = columns
        return logits[0]

    def parts(self, asked: Asked) -> Iterator[Part]:
        """The motion in parts, as they are ready."""
        codes: list[int] = []
        sent, left, last = 0, asked.frames, None
        wanted = -(-asked.frames // self.per_token)
        for code in self.tokens(asked):
            codes.append(code)
            is_whole = len(codes) == wanted
            ready = len(codes) - (0 if is_whole else HELD_BACK)
            if ready < sent + (1 if is_whole else LATER_PART if sent else FIRST_PART):
                continue
            lead = max(sent - LEAD, 0)
            first, frames = (sent - lead) * self.per_token, min((ready - sent) * self.per_token, left)
            part = placed(self.decode(codes[lead:]), first, frames, last)
            sent, left, last = ready, left - frames, part.root[-1]
            yield part

    def whole(self, asked: Asked) -> Part:
        """The motion, decoded at once."""
        part = self.decode(list(self.tokens(asked)))
        return Part(part.root[: asked.frames], part.rotations[: asked.frames])

    def decode(self, codes: list[int]) -> Part:
        """Frames of codes, in the frame of the first root."""
        pose, root = self.decoder.run(["pose", "root"], {"tokens": np.array([codes], np.int64)})
        return Part(root[0], pose[0].reshape(-1, self.joints, 9)[..., 3:].reshape(len(root[0]), -1))


def placed(window: Part, first: int, frames: int, last: np.ndarray | None) -> Part:
    """Frames of a window from `first` on. The one before them is laid onto the root ``[5]`` of the last frame that there is."""
    part = Part(window.root[first : first + frames], window.rotations[first : first + frames])
    if last is None:
        return part
    seam = window.root[first - 1]
    cosine, sine = last[3] * seam[3] + last[4] * seam[4], last[4] * seam[3] - last[3] * seam[4]
    turn = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]], np.float32)
    root = np.empty_like(part.root)
    root[:, :3] = part.root[:, :3] @ turn.T
    root[:, [0, 2]] += last[[0, 2]] - (turn @ seam[:3])[[0, 2]]
    root[:, 3] = part.root[:, 3] * cosine - part.root[:, 4] * sine
    root[:, 4] = part.root[:, 4] * cosine + part.root[:, 3] * sine
    return Part(root, (part.rotations.reshape(frames, -1, 3) @ turn.T).reshape(frames, -1))
