"""Paths as users draw them, unrolled updates, and windows by their speed."""

import math
from pathlib import Path

import pytest
import torch
from torch import Generator, Tensor

from troupe_training.data.bodies_store import Corpus
from troupe_training.data.conventions import FPS
from troupe_training.models.unimogen.config import PRESETS
from troupe_training.models.unimogen.diffusion import cosine_signal, sampler_steps
from troupe_training.models.unimogen.network import UniMoGen
from troupe_training.models.unimogen.state import Path2D, Range, decode, encode
from troupe_training.train.unimogen.diffusion import CHAINS, Rows, Task, drawn_steps, given_frames, unrolled
from troupe_training.train.unimogen.drawn import at_even_speed, drawn_paths, point_frames
from troupe_training.train.unimogen.losses import way_loss
from troupe_training.train.unimogen.paths import wanted_paths

LIMITS = Range(torch.tensor([-0.2, -0.9, -0.2]), torch.tensor([0.2, 0.5, 0.3]))


def walks(count: int, frames: int = 68) -> Tensor:
    """Roots ``[count, frames, 3]`` (x, z, heading) that sway, change their speed at every step and face along their arc."""
    time = torch.arange(frames) / FPS
    phase = 2 * math.pi * (time + torch.linspace(0, 1, count)[:, None])
    way = 1.2 * time + 0.02 * torch.sin(2 * phase)
    heading = 0.2 * way
    x = (1 - torch.cos(heading)) / 0.2 + 0.03 * torch.sin(phase)
    return torch.stack([x, torch.sin(heading) / 0.2, heading], -1)


def test_drawn_paths_are_even_and_face_along_the_curve():
    true = walks(64)
    path, fits = drawn_paths(true, 0.9, Generator().manual_seed(0))
    assert fits.all()
    step = (path[:, 1:, :2] - path[:, :-1, :2]).norm(dim=-1)
    assert float((step.std(1) / step.mean(1)).max()) < 0.02
    assert float((path[..., :2] - true[..., :2]).norm(dim=-1).max()) < 0.25
    moved = path[:, 1:, :2] - path[:, :-1, :2]
    aside = (torch.atan2(moved[..., 0], moved[..., 1]) - path[:, 1:, 2]).abs().amax(1)
    assert 0.4 < float((aside < 0.05).float().mean()) < 1.0  # about 70 % take the curve's own heading


def test_headings_of_drawn_paths_stay_on_the_branch_of_the_root():
    true = walks(64) + torch.tensor([0.0, 0.0, 4 * math.pi])
    path, _ = drawn_paths(true, 0.9, Generator().manual_seed(0))
    assert float((path[..., 2] - true[..., 2]).abs().max()) < 1.0


def test_roots_that_stop_keep_their_own_timing():
    true = walks(8)
    true[:, 34:] = true[:, 34:35]
    assert not drawn_paths(true, 0.9, Generator().manual_seed(0))[1].any()


@pytest.mark.parametrize("frames", [20, 36, 68])
def test_points_of_a_drawn_path_are_two_to_four(frames: int):
    draws = torch.rand(200, 3, generator=Generator().manual_seed(0))
    found = [point_frames(frames, draw) for draw in draws]
    assert all(at[0] == 0 and at[-1] == frames - 1 and at == tuple(sorted(set(at))) for at in found)
    assert {len(at) for at in found} == {2, 3, 4}


def test_even_speed_keeps_a_curve_that_stands_still():
    still = torch.ones(2, 20, 2)
    torch.testing.assert_close(at_even_speed(still), still)


def test_some_drawn_paths_ignore_the_past_and_all_pass_the_targets():
    true, generator = walks(200), Generator().manual_seed(0)
    root = torch.stack([true[..., 0], torch.ones_like(true[..., 0]), true[..., 1]], -1)
    given = torch.zeros(200, 68)
    given[:, :4], given[:, -1] = 1.0, 1.0
    path = wanted_paths(root, true[..., 2], given, 0.9, generator)
    off = (path.points - true[..., :2]).norm(dim=-1)
    assert float(off[:, -1].max()) < 1e-4
    assert 0.1 < float((off[:, 3] > 1e-3).float().mean()) < 0.6


def test_paths_and_rows_are_exact_in_autocast():
    true, generator = walks(4) + torch.tensor([30.0, -40.0, 2.0]), Generator().manual_seed(0)
    root = torch.stack([true[..., 0], torch.ones_like(true[..., 0]), true[..., 1]], -1)
    with torch.autocast("cpu", torch.bfloat16):
        path = wanted_paths(root, true[..., 2], torch.ones(4, 68), 0.9, generator)
    off = (path.points - true[..., :2]).norm(dim=-1)
    assert float(off[:, 4:].max()) < 1e-4


def test_rows_are_exact_in_autocast(corpus_cache: Path):
    store = Corpus(corpus_cache, "train").stores["walker"]
    windows = store.draw(3, 20, Generator().manual_seed(0))
    path = Path2D(windows.root[..., [0, 2]], windows.heading)
    with torch.autocast("cpu", torch.bfloat16):
        root, bends = decode(store.body, encode(store.body, windows.root, windows.bends, path, LIMITS), path, LIMITS)
    torch.testing.assert_close(root, windows.root, atol=1e-4, rtol=0)
    torch.testing.assert_close(bends[..., 0], windows.bends[..., :3], atol=1e-3, rtol=0)


def test_half_of_the_windows_are_noised_at_steps_of_the_sampler():
    step = drawn_steps(4000, Generator().manual_seed(0))
    share = float(torch.isin(step, torch.tensor(sampler_steps(4))).float().mean())
    assert share == pytest.approx(0.5 + 0.5 * 4 / 50, abs=0.03) and int(step.max()) == 49


def test_unrolled_rows_are_those_of_the_sampler(corpus_cache: Path):
    store = Corpus(corpus_cache, "train").stores["walker"]
    generator, signal = Generator().manual_seed(0), torch.from_numpy(cosine_signal()).float()
    windows, given = store.draw(3, 20, generator), given_frames(3, 20, generator)
    path = wanted_paths(windows.root, windows.heading, given, store.body.size_m, generator)
    task = Task(Rows.of(store.body), store.body, windows, given, path, windows.words, LIMITS)

    class Knowing(UniMoGen):
        """Answers with the truth."""

        def forward(self, *args: object, **inputs: object) -> Tensor:
            return task.truth.flatten(0, 1)

    model = Knowing(PRESETS["tiny"], windows.words.shape[1])
    for chain in CHAINS:
        x = unrolled(model, task, chain, signal, generator)
        noise = (x - signal[chain[-1]].sqrt() * task.truth) / (1 - signal[chain[-1]]).sqrt()
        free = given[:, None, :, None].expand_as(x) == 0
        free[:, 0, :, 3:] = False  # channels that the root's place does not have
        assert float(noise[free].std()) == pytest.approx(1.0, abs=0.05)
        known = given[:, None, :, None].expand_as(x) > 0
        torch.testing.assert_close(x[known], task.truth[known])


def test_the_way_of_standing_feet_counts_only_if_they_stand_throughout():
    feet = torch.zeros(1, 8, 1, 3)
    feet[0, :, 0, 2] = 0.01 * torch.arange(8)
    stands, free = torch.ones(1, 8, 1), torch.ones(1, 8)
    assert float(way_loss(feet, stands, free)) == pytest.approx(0.05**2)
    stands[0, 3] = 0.0
    assert float(way_loss(feet, stands, free)) == 0.0
    stands[0, 3], free[0, 3] = 1.0, 0.0
    assert float(way_loss(feet, stands, free)) == 0.0


def test_drawn_paths_sway_as_the_root_does():
    true = walks(200)
    root = torch.stack([true[..., 0], torch.ones_like(true[..., 0]), true[..., 1]], -1)
    path = wanted_paths(root, true[..., 2], torch.zeros(200, 68), 0.9, Generator().manual_seed(0)).points
    inner = slice(17, 51)  # a stride of 30 frames and more
    speed = (path[:, 1:] - path[:, :-1]).norm(dim=-1)[:, inner]
    own = (true[:, 1:, :2] - true[:, :-1, :2]).norm(dim=-1)[:, inner]
    share = speed.std(1) / own.std(1)
    assert float((share > 0.7).float().mean()) > 0.7  # the rest are smoothed, or run through points
