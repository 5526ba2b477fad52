"""Baselines of packs: FSQ tokens, the deterministic transformer, and the single-head tokenizer."""

import json
from dataclasses import asdict, replace
from pathlib import Path

import pytest
import torch

from tests_support import job
from troupe_training.cli.main import main
from troupe_training.data.conventions import CONTEXT_FRAMES
from troupe_training.data.interpolation import interpolate
from troupe_training.data.motion import Motion
from troupe_training.data.store import ClipStore
from troupe_training.models import delta
from troupe_training.models.delta import DeltaInterpolator, DeltaMethod
from troupe_training.models.motionbricks.config import PRESETS, config_of
from troupe_training.models.motionbricks.pose_module import PoseModule
from troupe_training.models.motionbricks.quantizers import FiniteScalarQuantizer, MultiHeadQuantizer, quantizer_of
from troupe_training.models.motionbricks.root_module import RootModule
from troupe_training.models.motionbricks.tokenizer import Tokenizer
from troupe_training.train.delta import DELTA
from troupe_training.train.motionbricks.pose import POSE
from troupe_training.train.motionbricks.stages import train_stage
from troupe_training.train.motionbricks.tokenizer import TOKENIZER

FSQ = replace(PRESETS["test"], codes=60, code_dim=3, fsq_levels=(5, 4, 3))


@pytest.fixture
def store(cache: Path) -> ClipStore:
    return ClipStore(cache, "train")


def test_fsq_finds_its_own_codes():
    quantizer = FiniteScalarQuantizer(FSQ)
    tokens = torch.arange(60)[None, :, None].expand(1, 60, FSQ.heads)
    book = quantizer.embed(tokens)
    assert len(torch.unique(book[0, :, :3], dim=0)) == 60 and book.abs().max() <= 1.0
    # Latents that are bounded to the middle of each level come back as its code.
    half = (quantizer.levels - 1) * (1 - 1e-3) / 2
    offset = torch.where(quantizer.levels % 2 == 0, 0.5, 0.0)
    level = book.unflatten(-1, (FSQ.heads, 3)) * quantizer.levels.div(2, rounding_mode="floor")
    inside = ((level + offset) / half).clamp(-1 + 1e-6, 1 - 1e-6)
    latent = (torch.atanh(inside) - torch.atanh(offset / half)).flatten(2)
    assert torch.equal(quantizer.tokens(latent), tokens)


def test_fsq_rounds_and_lets_gradients_through():
    quantizer = FiniteScalarQuantizer(FSQ)
    latent = torch.randn(2, 4, FSQ.heads * 3, requires_grad=True)
    embedded, tokens, commitment = quantizer(latent)
    assert torch.allclose(embedded, quantizer.embed(tokens), atol=1e-6)
    assert float(commitment) == 0.0
    assert int(tokens.min()) >= 0 and int(tokens.max()) < 60
    embedded.sum().backward()
    assert (latent.grad > 0).all()


def test_fsq_by_hand():
    """Five levels are -2 to 2: a latent of 0 is in the middle, large ones at the ends."""
    quantizer = FiniteScalarQuantizer(replace(FSQ, heads=1, codes=5, code_dim=1, fsq_levels=(5,)))
    assert quantizer.tokens(torch.tensor([[[-9.0], [0.0], [0.1], [9.0]]]))[0, :, 0].tolist() == [0, 2, 2, 4]
    assert quantizer.book[0, :, 0].tolist() == [-1.0, -0.5, 0.0, 0.5, 1.0]
    even = FiniteScalarQuantizer(replace(FSQ, heads=1, codes=4, code_dim=1, fsq_levels=(4,)))
    assert even.tokens(torch.tensor([[[-9.0], [0.0], [9.0]]]))[0, :, 0].tolist() == [0, 2, 3]


def test_fsq_levels_must_make_the_codes():
    with pytest.raises(ValueError, match="60 codes of 3 dimensions"):
        quantizer_of(replace(FSQ, codes=16))
    with pytest.raises(ValueError, match="no middle"):
        quantizer_of(replace(FSQ, codes=4, code_dim=2, fsq_levels=(2, 2)))
    assert isinstance(quantizer_of(PRESETS["test"]), MultiHeadQuantizer)


def test_an_fsq_tokenizer_learns_and_feeds_the_pose_module(cache: Path, tmp_path: Path, store: ClipStore):
    for stage, steps in (("tokenizer", 120), ("root", 10), ("pose", 20)):
        assert train_stage(stage, job(cache, tmp_path, steps), FSQ)
    history = json.loads((tmp_path / "tokenizer.json").read_text())["history"]
    assert history[-1]["total"] < 0.8 * history[0]["total"]
    assert isinstance(TOKENIZER.load(tmp_path, store).quantizer, FiniteScalarQuantizer)
    assert POSE.load(tmp_path, store).codes == 60


def test_the_delta_baseline_keeps_what_is_given_and_learns(cache: Path, tmp_path: Path, store: ClipStore):
    for steps in ("60", "120"):  # the second call goes on
        argv = ["train", "delta", "--run", str(tmp_path), "--cache", str(cache), "--preset", "test"]
        assert main([*argv, "--steps", steps, "--frames-per-step", "1024", "--threads", "1"]) == 0
    history = json.loads((tmp_path / "delta.json").read_text())["history"]
    assert history[-1]["total"] < 0.9 * history[0]["total"]
    method = DeltaMethod(DELTA.load(tmp_path, store), store.skeleton)
    for frames in (12, 35, 50):
        segments = store.segments(store.sample(3, 52, torch.Generator().manual_seed(1)), frames)
        truth, made = Motion.of(segments), method(segments, frames)
        given = [*range(CONTEXT_FRAMES), frames - 1]
        assert torch.allclose(made.root[:, given], truth.root[:, given], atol=1e-5)
        assert torch.allclose(made.rotations[:, given], truth.rotations[:, given], atol=2e-3)
        hidden = segments
        for name in ("positions", "six_d", "global_root"):
            getattr(hidden, name)[:, CONTEXT_FRAMES : frames - 1] = 0.5
        again = method(hidden, frames)
        assert torch.allclose(again.rotations, made.rotations, atol=1e-5), "it does not see the gap"


def test_an_untrained_delta_baseline_is_near_interpolation(store: ClipStore):
    method = DeltaMethod(DELTA.build(delta.PRESETS["test"], store).eval(), store.skeleton)
    segments = store.segments(store.sample(4, 32, torch.Generator().manual_seed(1)), 30)
    between = interpolate(Motion.of(segments), 30, store.skeleton.parents)
    assert (method(segments, 30).root - between.root).norm(dim=-1).max() < 0.3


def parameters(module: torch.nn.Module) -> int:
    return sum(p.numel() for p in module.parameters())


def test_the_delta_baseline_is_of_a_packs_size():
    config = PRESETS["default"]
    pack = (Tokenizer(config, 21, 4).decoder, RootModule(config, 21), PoseModule(config, 21))
    ours = parameters(DeltaInterpolator(delta.PRESETS["default"], 21))
    assert ours == pytest.approx(sum(parameters(m) for m in pack), rel=0.1)


def test_the_single_head_ablation_differs_in_its_codes_alone():
    single, default = PRESETS["single-head"], PRESETS["default"]
    assert single.heads == 1 and single.heads * single.code_dim == default.heads * default.code_dim
    assert replace(single, heads=4, codes=256, code_dim=24) == default
    encoder = parameters(Tokenizer(single, 21, 4).encoder)
    assert encoder == parameters(Tokenizer(default, 21, 4).encoder)


def test_checkpoints_of_before_can_be_read():
    """A run's configuration without the later fields, and with what it noted of the baseline."""
    old = asdict(PRESETS["default"]) | {"delta_dim": 320, "delta_layers": 9}
    del old["fsq_levels"]
    assert config_of(**old) == PRESETS["default"]
