"""VerMo's graphs: what of the networks goes into each ONNX file, and how far the files are from PyTorch."""

import copy
from dataclasses import dataclass
from pathlib import Path

import onnx
import torch
from torch import Tensor, nn

from troupe_training.data.rotations import matrix_to_six_d, six_d_to_matrix
from troupe_training.export.onnx import Axes, Session, graph_of, largest_of, round_to_half, store_as_half
from troupe_training.models.layers import unroll_convolutions
from troupe_training.models.vermo.config import MAX_TOKENS, RATE
from troupe_training.models.vermo.flow import FlowDecoder
from troupe_training.models.vermo.frames import Body
from troupe_training.models.vermo.language import LanguageModel, Served
from troupe_training.models.vermo.tokenizer import Tokenizer

OPSET = 20
FILES = ("language", "encoder", "decoder", "flow")  # in the order of the content hash
Inputs = dict[str, Tensor]
MOST = 4096  # of any open axis


@dataclass
class Networks:
    """The networks of a pack."""

    tokenizer: Tokenizer
    language: LanguageModel
    flow: FlowDecoder | None = None

    def parameters(self) -> int:
        """Numbers that were learnt."""
        modules = [m for m in (self.tokenizer, self.language, self.flow) if m is not None]
        return sum(p.numel() for m in modules for p in m.parameters())


class EncoderGraph(nn.Module):
    """Frames to tokens."""

    def __init__(self, tokenizer: Tokenizer):
        super().__init__()
        self.tokenizer = tokenizer

    def forward(self, pose: Tensor, root: Tensor) -> Tensor:
        """``[B, F, 9 J]`` and ``[B, F, 5]`` to ``[B, T]``."""
        return self.tokenizer.encode(pose, root)


class DecoderGraph(nn.Module):
    """Tokens to frames."""

    def __init__(self, tokenizer: Tokenizer):
        super().__init__()
        self.tokenizer = tokenizer

    def forward(self, tokens: Tensor) -> tuple[Tensor, Tensor]:
        """``[B, T]`` to ``[B, F, 9 J]`` and ``[B, F, 5]``."""
        return self.tokenizer.decode(tokens)


class FlowGraph(nn.Module):
    """One Euler step, and the frames of its result."""

    def __init__(self, tokenizer: Tokenizer, flow: FlowDecoder):
        super().__init__()
        self.tokenizer, self.flow = tokenizer, flow

    def forward(self, tokens: Tensor, state: Tensor, time: Tensor, delta: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """``next`` ``[B, F, D]``, a remainder like ``state``; pose and root."""
        levels = self.tokenizer.embed(tokens)
        drafted = self.tokenizer.decoder(levels)
        later = state + delta[:, None, None] * self.flow(state, drafted, levels, time)
        shown = self.flow.finished(later, drafted)
        pose, root = self.tokenizer.body.frames(self.tokenizer.state_scale.invert(shown))
        return later, pose, root


def shipped(networks: Networks) -> Networks:
    """Copies as they are shipped: weights rounded to 16 bits, and the language model's table added up before that."""
    copied = copy.deepcopy(networks)
    language = copied.language
    with torch.no_grad():
        language.own.copy_(language.table())
        language.shared.zero_()
    for module in (copied.tokenizer, language, copied.flow):
        if module is not None:
            round_to_half(module.eval().requires_grad_(False))
    return copied


def random_motion(body: Body, batch: int, tokens: int, seed: int) -> Inputs:
    """Pose features and roots of poses near the identity that sway and walk."""
    generator = torch.Generator().manual_seed(seed)
    frames = tokens * RATE
    time = torch.arange(frames)[None, :, None] / 30.0
    phase, rate = (torch.rand(batch, 1, body.state_width, generator=generator) * scale for scale in (6.28, 9.0))
    sway = torch.sin(time * rate + phase) * 0.5
    upright = torch.tensor([1.0, 0, 0, 0, 1, 0]).repeat(body.joints)
    local = torch.tensor([0.0, 1.0, 0.0, 0.9])
    state = sway * torch.cat([torch.ones(6 * body.joints), torch.tensor([1.0, 2.0, 3.0, 0.1])]) + torch.cat(
        [upright, local]
    )
    six_d = matrix_to_six_d(six_d_to_matrix(state[..., : 6 * body.joints].unflatten(-1, (-1, 6)))).flatten(2)
    pose, root = body.frames(torch.cat([six_d, state[..., 6 * body.joints :]], -1))
    return {"pose": pose, "root": root}


def random_tokens(networks: Networks, batch: int, tokens: int, seed: int) -> Tensor:
    """Motion codes."""
    generator = torch.Generator().manual_seed(seed)
    return torch.randint(networks.tokenizer.config.codes, (batch, tokens), generator=generator)


def language_inputs(language: LanguageModel, sequences: int, length: int, cached: int, seed: int) -> Inputs:
    """Random tokens behind a random cache."""
    generator, config = torch.Generator().manual_seed(seed), language.config
    shape = (sequences, config.layers, 2, config.key_heads, cached, config.head_width)
    return {
        "tokens": torch.randint(language.vocabulary.size, (sequences, length), generator=generator),
        "count": torch.randint(1, length + 1, (sequences,), generator=generator),
        "start": torch.randint(0, cached + 1, (sequences,), generator=generator),
        "cache": torch.randn(shape, generator=generator),
    }


def flow_inputs(networks: Networks, batch: int, tokens: int, seed: int) -> Inputs:
    """Random states at random times."""
    generator, width = torch.Generator().manual_seed(seed), networks.tokenizer.body.state_width
    return {
        "tokens": random_tokens(networks, batch, tokens, seed),
        "state": torch.randn(batch, tokens * RATE, width, generator=generator),
        "time": torch.rand(batch, generator=generator),
        "delta": torch.rand(batch, generator=generator) * 0.2,
    }


def write_graph(module: nn.Module, inputs: Inputs, outputs: list[str], axes: list[Axes], path: Path) -> None:
    """Writes one ONNX file with 16-bit weights."""
    module = copy.deepcopy(module).eval()
    unroll_convolutions(module)
    graph = graph_of(module, inputs, outputs, axes, OPSET)
    store_as_half(graph)
    graph.doc_string = f"Troupe VerMo {path.stem}"
    onnx.checker.check_model(graph)
    onnx.save(graph, path)


def write_graphs(networks: Networks, folder: Path) -> dict[str, float]:
    """All files of networks as `shipped` gives them, and the largest difference of each to PyTorch."""
    dim = torch.export.Dim
    batch, tokens = dim("batch", min=1, max=MOST), dim("tokens", min=1, max=MAX_TOKENS)
    frames = RATE * tokens
    sequences, columns, cached = (dim(name, min=1, max=MOST) for name in ("sequences", "columns", "cached"))
    body, checks = networks.tokenizer.body, {}
    language = networks.language
    served = Served(language)
    axes: list[Axes] = [{0: sequences, 1: columns}, {0: sequences}, {0: sequences}, {0: sequences, 4: cached}]
    write_graph(served, language_inputs(language, 3, 5, 9, 1), ["logits", "columns"], axes, folder / "language.onnx")
    sizes = ((1, 1, 1), (4, 1, 31), (2, 17, 1), (5, 12, 40))
    checks["language"] = largest(
        served, [language_inputs(language, *size, seed=n) for n, size in enumerate(sizes)], folder / "language.onnx"
    )
    encoder, decoder = EncoderGraph(networks.tokenizer), DecoderGraph(networks.tokenizer)
    motion: list[Axes] = [{0: batch, 1: frames}, {0: batch, 1: frames}]
    write_graph(encoder, random_motion(body, 3, 5, 1), ["tokens"], motion, folder / "encoder.onnx")
    checks["encoder"] = other_tokens(
        encoder, [random_motion(body, *size) for size in ((1, 4, 2), (5, 13, 3))], folder / "encoder.onnx"
    )
    some = {"tokens": random_tokens(networks, 3, 5, 1)}
    write_graph(decoder, some, ["pose", "root"], [{0: batch, 1: tokens}], folder / "decoder.onnx")
    several = [{"tokens": random_tokens(networks, *size)} for size in ((1, 1, 2), (2, 4, 3), (5, 30, 4))]
    checks["decoder"] = largest(decoder, several, folder / "decoder.onnx")
    if networks.flow is not None:
        flow = FlowGraph(networks.tokenizer, networks.flow)
        axes = [{0: batch, 1: tokens}, {0: batch, 1: frames}, {0: batch}, {0: batch}]
        write_graph(flow, flow_inputs(networks, 3, 5, 1), ["next", "pose", "root"], axes, folder / "flow.onnx")
        several = [flow_inputs(networks, *size) for size in ((1, 2, 2), (4, 20, 3))]
        checks["flow"] = largest(flow, several, folder / "flow.onnx")
    return checks


def largest(module: nn.Module, several: list[Inputs], path: Path) -> float:
    """The largest difference between ONNX Runtime and PyTorch over all outputs."""
    session, worst = Session(path, 1), 0.0
    for inputs in several:
        with torch.no_grad():
            expected = module(*inputs.values())
        found = session.run(inputs)
        worst = max(worst, *(largest_of(a - b) for a, b in zip(found.values(), expected, strict=True)))
    return worst


def other_tokens(module: nn.Module, several: list[Inputs], path: Path) -> float:
    """The share of tokens that ONNX Runtime gives otherwise: latents halfway between two levels go either way."""
    session, other, count = Session(path, 1), 0, 0
    for inputs in several:
        with torch.no_grad():
            expected = module(*inputs.values())
        other += int((session.run(inputs)["tokens"] != expected).sum())
        count += expected.numel()
    return other / count
