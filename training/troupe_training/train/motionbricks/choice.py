"""The training of the root's choice: the root module stays as it is, and what it misses is explained by curves.

What is missed of a clip is taken as a draw from a normal distribution with the covariance F F^T + R: F are the curves, R is
diagonal, what no curve explains. The loss is its exact negative log-likelihood (Woodbury's identity: matrices of K, not of all
frames). Speeds are observed beside places, so that curves that shake are as unlikely as curves that are off.

Misses have heavier tails than a normal distribution: the likeliest curves are half as wide again as most misses are. So in
the second half of the budget the energy score (Gneiting and Raftery 2007) of drawn roots takes over, which is least for
draws as far from one another as from what was captured.
"""

import hashlib
from typing import Any

import torch
from torch import Generator, Tensor

from troupe_training.data.conventions import CONTEXT_FRAMES, FPS
from troupe_training.data.precision import full_precision
from troupe_training.data.store import ClipEntry, ClipStore, Segments
from troupe_training.models.motionbricks.config import ModelConfig, config_of
from troupe_training.models.motionbricks.root_choice import CHANNELS, RootChoice
from troupe_training.models.motionbricks.root_module import RootModule, RootPass
from troupe_training.train.checkpoints import Checkpoint, Stage
from troupe_training.train.motionbricks.masks import random_slot_masks
from troupe_training.train.motionbricks.root import root_pass
from troupe_training.train.trainer import Loss

# In what places (m, rad) and speeds (m/s, rad/s) are measured, by channel; of the size of what is
# missed.
PLACE_UNITS = (0.01, 0.005, 0.01, 0.02)
SPEED_UNITS = (0.1, 0.1, 0.1, 0.3)
# Nearer to given frames than this the envelope leaves no choice, and nothing is observed.
SMALLEST_ENVELOPE = 1e-3
# One file in so many, and at least so many files, are kept from the curves, to tell how wide they
# must be for others.
HELD_BACK, FEWEST_HELD_BACK = 10, 4
HELD_BATCHES = 60
WIDTHS = torch.linspace(0.4, 2.0, 65)
SCORED_FROM = 0.5  # share of the budget after which draws are scored
LIKELIHOOD_AFTER = 0.05  # weight of the likelihood from there on
SCORED_DRAWS = 4


def build_choice(config: ModelConfig, store: ClipStore) -> RootChoice:
    """A new choice; it has no standardisation constants."""
    return RootChoice(config)


CHOICE = Stage("choice", config_of, build_choice)


def file_of(clip: ClipEntry) -> str:
    """The file that a clip, mirrored or not, was cut from."""
    return clip.get("file", clip["name"])


def held_back(store: ClipStore) -> set[str]:
    """Files of a store that are kept from the curves: those with the least hashes of their names."""
    files = {file_of(clip) for clip in store.clips}
    order = sorted(files, key=lambda name: hashlib.sha256(b"choice " + name.encode()).digest())
    return set(order[: min(max(len(files) // HELD_BACK, FEWEST_HELD_BACK), len(files) // 3)])


@full_precision
def missed(root: Tensor, truth: Tensor) -> Tensor:
    """What takes roots ``[..., 5]`` to the true ones: places and the angle between the headings, ``[..., 4]``."""
    c, s, true_c, true_s = root[..., 3], root[..., 4], truth[..., 3], truth[..., 4]
    turn = torch.atan2(c * true_s - s * true_c, c * true_c + s * true_s)
    return torch.cat([truth[..., :3] - root[..., :3], turn[..., None]], -1)


@full_precision
def factor_likelihood(observed: Tensor, factors: Tensor, rest: Tensor) -> Tensor:
    """Negative log-likelihood ``[B]`` of ``observed`` ``[B, D]`` under N(0, F F^T + diag(rest)).

    ``factors`` ``[B, D, K]``, variances ``rest`` ``[B, D]``.
    """
    weighted = factors / rest[..., None]
    small = torch.eye(factors.shape[-1], device=factors.device) + weighted.transpose(1, 2) @ factors
    lower = torch.linalg.cholesky(small)
    projected = (weighted * observed[..., None]).sum(1)
    explained = torch.linalg.solve_triangular(lower, projected[..., None], upper=False)[..., 0].square().sum(-1)
    square = (observed.square() / rest).sum(-1) - explained
    volume = rest.log().sum(-1) + 2.0 * lower.diagonal(dim1=-2, dim2=-1).log().sum(-1)
    return 0.5 * (square + volume + observed.shape[-1] * torch.log(torch.tensor(2.0 * torch.pi)))


@full_precision
def posterior(observed: Tensor, factors: Tensor, rest: Tensor) -> tuple[Tensor, Tensor]:
    """Mean ``[B, K]`` and the Cholesky factor of the precision ``[B, K, K]`` of what chose ``observed``."""
    weighted = factors / rest[..., None]
    small = torch.eye(factors.shape[-1], device=factors.device) + weighted.transpose(1, 2) @ factors
    lower = torch.linalg.cholesky(small)
    mean = torch.cholesky_solve((weighted * observed[..., None]).sum(1)[..., None], lower)[..., 0]
    return mean, lower


@full_precision
def observation(
    missing: Tensor, curves: Tensor, envelope: Tensor, log_rest: Tensor
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Places and speeds as one vector: what is observed ``[B, D]``, factors ``[B, D, K]``, variances and 0/1 ``[B, D]``.

    ``missing`` ``[B, T, 4]``, ``curves`` ``[B, T, K, 4]``, ``envelope`` ``[B, T]``.
    Entries of given frames are zero, with a variance of 1.
    """
    open_ = (envelope > SMALLEST_ENVELOPE).float()
    missing = missing * open_[..., None]
    units = torch.tensor((PLACE_UNITS, SPEED_UNITS), device=missing.device)
    values = torch.cat([missing[:, :, None], curves], 2)  # what is observed as one more curve
    place = values[:, CONTEXT_FRAMES:] / units[0]
    speed = (values[:, CONTEXT_FRAMES:] - values[:, CONTEXT_FRAMES - 1 : -1]) * FPS / units[1]
    # Speeds count where both frames are open; the first after the context starts from its last,
    # where nothing is missed.
    both = open_[:, CONTEXT_FRAMES:] * torch.cat([torch.ones_like(open_[:, :1]), open_[:, CONTEXT_FRAMES:-1]], 1)
    counts = torch.stack([open_[:, CONTEXT_FRAMES:], both], 1)[..., None].expand(-1, -1, -1, CHANNELS)  # [B, 2, T', 4]
    stacked = torch.stack([place, speed], 1) * counts[:, :, :, None]  # [B, 2, T', K + 1, 4]
    flat = stacked.movedim(3, -1).flatten(1, 3)
    rest = torch.exp(2.0 * log_rest)[None, :, None] * counts + (1.0 - counts)
    return flat[..., 0], flat[..., 1:], rest.flatten(1), counts.flatten(1)


@full_precision
def energy_score(observed: Tensor, drawn: Tensor) -> Tensor:
    """Mean distance of draws ``[S, B, D]`` to what is ``observed`` ``[B, D]``, less half of that between draws: ``[B]``.

    Of places and speeds apart and frame by frame, in their units.
    """

    def apart(difference: Tensor) -> Tensor:
        return (difference.unflatten(-1, (-1, CHANNELS)).square().sum(-1) + 1e-8).sqrt().mean(-1)

    count = len(drawn)
    off = apart(drawn - observed).mean(0)
    between = torch.stack([apart(drawn[i] - drawn[j]) for i in range(count) for j in range(i)]).mean(0)
    return off - 0.5 * between


def drawn_curves(factors: Tensor, draws: int, generator: Generator) -> Tensor:
    """``[S, B, D]``: factors ``[B, D, K]`` times standard normal numbers."""
    noise = torch.randn(draws, len(factors), factors.shape[-1], generator=generator).to(factors.device)
    return torch.einsum("bdk,sbk->sbd", factors, noise)


def observe(choice: RootChoice, given: RootPass, truth: Segments) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """`observation` of segments whose root the root module has predicted."""
    frames = truth.frames
    missing = missed(given.root[:, :frames], truth.global_root)
    return observation(missing, choice.curves(given)[:, :frames], given.envelope[:, :frames], choice.log_rest)


def choice_pass(
    store: ClipStore, frames_budget: int, root: RootModule, generator: Generator
) -> tuple[RootPass, Segments]:
    """The root module's answer to a random batch of requests of known length."""
    segments = store.batch(frames_budget, generator)
    masks = random_slot_masks(len(segments.pose), generator)
    with torch.no_grad():
        return root_pass(root, segments, masks, torch.ones(len(segments.pose)))[1], segments


def choice_loss(store: ClipStore, frames_budget: int, root: RootModule) -> Loss[RootChoice]:
    """Loss of the choice: negative log-likelihood for each number that is observed, then the energy score of draws.

    Files that are held back are noted alone.
    """
    files = held_back(store)
    seen, kept = store.part(lambda clip: file_of(clip) not in files), store.part(lambda clip: file_of(clip) in files)

    def terms_of(model: RootChoice, of: ClipStore, generator: Generator, frames: int) -> tuple[Tensor, Tensor]:
        given, segments = choice_pass(of, frames, root, generator)
        observed, factors, rest, counts = observe(model, given, segments)
        likelihood = factor_likelihood(observed, factors, rest).sum() / counts.sum()
        return likelihood, energy_score(observed, drawn_curves(factors, SCORED_DRAWS, generator)).mean()

    def loss(model: RootChoice, generator: Generator, progress: float) -> dict[str, Tensor]:
        likelihood, score = terms_of(model, seen, generator, frames_budget)
        scored = progress >= SCORED_FROM
        terms = {
            "likelihood": likelihood * (LIKELIHOOD_AFTER if scored else 1.0),
            "score" if scored else "_score": score,
        }
        if kept.lengths():
            with torch.no_grad():
                terms["_held_back"], terms["_held_score"] = terms_of(model, kept, generator, frames_budget // 4)
        return terms

    return loss


@torch.no_grad()
def fitted_width(choice: RootChoice, store: ClipStore, frames_budget: int, root: RootModule, seed: int) -> float:
    """By how much the curves must be multiplied for the best energy score on the held-back clips; 1 without any.

    If the cache has mirrored clips, it is fitted on those: the root module of an adopted pack may know the others by heart.
    """
    files = held_back(store)
    kept = store.part(lambda clip: file_of(clip) in files)
    mirrored = kept.part(lambda clip: clip.get("mirrored", False))
    kept = mirrored if mirrored.lengths() else kept
    if not kept.lengths():
        return 1.0
    generator = Generator().manual_seed(seed)
    totals = torch.zeros(len(WIDTHS))
    for _ in range(HELD_BATCHES):
        given, segments = choice_pass(kept, frames_budget, root, generator)
        observed, factors, _, _ = observe(choice, given, segments)
        drawn = drawn_curves(factors, SCORED_DRAWS, generator)
        totals += torch.stack([energy_score(observed, drawn * width).mean() for width in WIDTHS])
    return float(WIDTHS[totals.argmin()])


def widen(checkpoint: Checkpoint, width: float) -> Checkpoint:
    """A checkpoint whose averaged weights give curves ``width`` times as wide."""
    average: dict[str, Any] = dict(checkpoint["average"])
    for name in ("read.weight", "read.bias"):
        average[name] = average[name] * width
    return {**checkpoint, "average": average, "meta": checkpoint["meta"] | {"width": width}}


@torch.no_grad()
def chosen_root(choice: RootChoice, given: RootPass, truth: Segments, generator: Generator) -> Tensor:
    """Roots ``[B, T, 5]`` drawn from those that may have led to the captured one: the choice's posterior."""
    observed, factors, rest, _ = observe(choice, given, truth)
    mean, lower = posterior(observed, factors, rest)
    noise = torch.randn(mean.shape, generator=generator).to(mean.device)
    spread = torch.linalg.solve_triangular(lower.transpose(1, 2), noise[..., None], upper=True)[..., 0]
    return choice(given, mean + spread)[:, : truth.frames]
