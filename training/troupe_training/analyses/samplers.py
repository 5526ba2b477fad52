"""Ways to draw several answers to one request, each with other stages of the method free: what `diversity` compares."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import torch
from torch import Tensor

from troupe_training.data.conventions import CONTEXT_FRAMES
from troupe_training.data.motion import Motion
from troupe_training.data.rotations import yaw_matrix
from troupe_training.data.store import Segments
from troupe_training.evaluate.bench import Bench, Sampling
from troupe_training.evaluate.motionbricks import Keys, Plan, StageNetworks, choose_tokens, decode, make_plan
from troupe_training.evaluate.nearest import NearestWindows

SIMILAR = 10  # training windows whose roots, or frames, stand for what else might have happened
LIKELIEST = 8  # codes of each token that are tried when tokens are fitted


@dataclass
class Requests:
    """A batch of windows to answer several times; what does not depend on the seed is computed once."""

    bench: Bench
    networks: StageNetworks
    near: NearestWindows
    segments: Segments
    frames: int

    @cached_property
    def mode(self) -> Plan:
        """The plan at temperature 0."""
        return make_plan(self.networks, Keys.of(self.segments, self.frames), self.frames, Sampling())

    @cached_property
    def similar(self) -> Tensor:
        """Starts ``[B, SIMILAR]`` of the training windows with the nearest given frames."""
        return self.near.find(self.segments, self.frames, SIMILAR)[0]

    def missed_roots(self, nth: int) -> tuple[Tensor, Tensor]:
        """The root stage's error on the nth similar training window: places ``[B, T, 3]`` and headings ``[B, T]``."""
        other = self.near.store.segments(self.similar[:, nth], self.frames)
        made = make_plan(self.networks, Keys.of(other, self.frames), self.frames, Sampling())
        root, true = made.global_root[:, : self.frames], other.global_root
        cosine = (root[..., 3:] * true[..., 3:]).sum(-1)
        sine = root[..., 3] * true[..., 4] - root[..., 4] * true[..., 3]
        return true[..., :3] - root[..., :3], torch.atan2(sine, cosine)


# From a batch of requests to a motion for each seed.
Sampler = Callable[[Requests, int], Motion]


def likeliest(requests: Requests, seed: int) -> Motion:
    """The answer at temperature 0."""
    return decode(requests.networks, requests.mode)


def tokens_at(sampling: Sampling) -> Sampler:
    """Pose tokens drawn, root as it is: what the server varies."""

    def draw(requests: Requests, seed: int) -> Motion:
        chosen = choose_tokens(requests.networks, requests.mode, replace(sampling, seed=seed))
        return decode(requests.networks, replace(requests.mode, tokens=chosen))

    return draw


def served(sampling: Sampling) -> Sampler:
    """Everything drawn that the pack lets be drawn: tokens, and roots if it has a choice of them."""

    def draw(requests: Requests, seed: int) -> Motion:
        keys = Keys.of(requests.segments, requests.frames)
        return decode(
            requests.networks, make_plan(requests.networks, keys, requests.frames, replace(sampling, seed=seed))
        )

    return draw


def any_tokens(requests: Requests, seed: int) -> Motion:
    """Tokens of codes drawn evenly: no decoder can vary more by its tokens."""
    generator = torch.Generator().manual_seed(seed)
    tokens = torch.randint(requests.networks.codes, requests.mode.tokens.shape, generator=generator)
    return decode(requests.networks, replace(requests.mode, tokens=tokens))


def others_tokens(requests: Requests, seed: int) -> Motion:
    """The likeliest tokens of another window of the batch: a real motion, but not this one."""
    return decode(requests.networks, replace(requests.mode, tokens=requests.mode.tokens.roll(seed + 1, 0)))


def with_missed_roots(requests: Requests, seed: int, scale: float) -> Plan:
    """The plan's root with ``scale`` times what the root stage misses of a similar training window added."""
    plan = requests.mode
    place, turn = (scale * missed for missed in requests.missed_roots(seed % SIMILAR))
    root = plan.global_root.clone()
    root[:, : requests.frames, :3] += place
    heading = torch.atan2(root[:, : requests.frames, 4], root[:, : requests.frames, 3]) + turn
    root[:, : requests.frames, 3:] = torch.stack([torch.cos(heading), torch.sin(heading)], -1)
    return replace(plan, global_root=root)


def roots(sampling: Sampling | None = None, scale: float = 1.0) -> Sampler:
    """Roots drawn, pose tokens at the mode or drawn too.

    The root stage has nothing to draw from. What it misses of the training windows most like the request stands in for a
    stage that had. It knows those windows and misses less of them than of others: ``scale`` makes up for it.
    """

    def draw(requests: Requests, seed: int) -> Motion:
        plan = with_missed_roots(requests, seed, scale)
        how = replace(sampling, seed=seed) if sampling else Sampling()
        return decode(requests.networks, replace(plan, tokens=choose_tokens(requests.networks, plan, how)))

    return draw


def hidden(sampling: Sampling, frames: Callable[[int], list[int]]) -> Sampler:
    """Pose tokens drawn as usual, and some keyframes kept from the decoder, which then has its tokens to go by."""

    def draw(requests: Requests, seed: int) -> Motion:
        plan = replace(
            requests.mode, tokens=choose_tokens(requests.networks, requests.mode, replace(sampling, seed=seed))
        )
        mask, pose = plan.frame_mask.clone(), plan.frame_pose.clone()
        mask[:, frames(requests.frames)] = 0.0
        pose[:, frames(requests.frames)] = 0.0
        return decode(requests.networks, replace(plan, frame_mask=mask, frame_pose=pose))

    return draw


def similar_windows(requests: Requests, seed: int) -> Motion:
    """The training windows most like the request themselves, blended: the baseline's many answers."""
    return requests.near.answers(requests.segments, requests.frames, requests.similar[:, seed % SIMILAR])


def captured_root(requests: Requests, seed: int) -> Motion:
    """The likeliest tokens along the captured root: what the root stage loses."""
    plan = with_captured_root(requests)
    return decode(requests.networks, replace(plan, tokens=choose_tokens(requests.networks, plan, Sampling())))


def with_captured_root(requests: Requests) -> Plan:
    """The plan with the captured motion's root in the place of the predicted one."""
    root = requests.mode.global_root.clone()
    root[:, : requests.frames] = requests.segments.global_root
    return replace(requests.mode, global_root=root)


def fitted_tokens(captured: bool) -> Sampler:
    """Tokens fitted to the captured motion, along the predicted or the captured root: the best that tokens can do.

    A pack has no encoder. One token after another takes the code, of the `LIKELIEST`, whose answer lies nearest.
    """

    def draw(requests: Requests, seed: int) -> Motion:
        plan = with_captured_root(requests) if captured else requests.mode
        logits = requests.networks.run("pose", tokens=_masked(requests, plan), **plan.inputs())["logits"]
        codes = logits.topk(min(LIKELIEST, requests.networks.codes), -1).indices  # [B, n, K, C]
        batch, slots, heads, count = codes.shape
        tokens = codes[..., 0].clone()
        truth = Motion.of(requests.segments).world(requests.bench.kinematics).repeat_interleave(count, 0)
        repeated = Plan(
            plan.frames,
            plan.tokens,
            *(
                getattr(plan, name).repeat_interleave(count, 0)
                for name in ("num_tokens", "global_root", "frame_pose", "frame_mask")
            ),
        )
        for slot in range(slots):
            for head in range(heads):
                tried = tokens.repeat_interleave(count, 0)
                tried[:, slot, head] = codes[:, slot, head].flatten()
                made = decode(requests.networks, replace(repeated, tokens=tried)).world(requests.bench.kinematics)
                best = (made - truth).norm(dim=-1).mean((1, 2)).reshape(batch, count).argmin(1)
                tokens[:, slot, head] = codes[torch.arange(batch), slot, head, best]
        return decode(requests.networks, replace(plan, tokens=tokens))

    return draw


def _masked(requests: Requests, plan: Plan) -> Tensor:
    return torch.full_like(plan.tokens, requests.networks.codes)


def certainty(requests: Requests) -> tuple[Tensor, Tensor]:
    """Of the pose stage's first pass: codes in play (perplexity) and the likeliest code's share, ``[B, n*K]`` each."""
    logits = requests.networks.run("pose", tokens=_masked(requests, requests.mode), **requests.mode.inputs())["logits"]
    log = torch.log_softmax(logits.double(), -1).flatten(1, 2)
    return (-(log.exp() * log).sum(-1)).exp(), log.amax(-1).exp()


def turned_to_heading(segments: Segments) -> Tensor:
    """Joint positions ``[B, T, J, 3]`` of captured windows as seen from their projected root and heading."""
    heading = torch.atan2(segments.global_root[..., 4], segments.global_root[..., 3])
    return torch.einsum("btij,btkj->btki", yaw_matrix(-heading), segments.positions)


def target(frames: int) -> list[int]:
    """The target's frame."""
    return [frames - 1]


def context_and_target(frames: int) -> list[int]:
    """All given frames."""
    return [*range(CONTEXT_FRAMES), frames - 1]
