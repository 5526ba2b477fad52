"""The root's choice: its likelihood, its score, where it must not move anything, and its way into a pack and back."""

from pathlib import Path

import onnx
import pytest
import torch
from torch.distributions import LowRankMultivariateNormal, MultivariateNormal

from tests_support import job
from troupe_training.cli.main import main
from troupe_training.data.conventions import CONTEXT_FRAMES
from troupe_training.data.store import ClipStore
from troupe_training.evaluate.bench import Sampling
from troupe_training.evaluate.motionbricks import Keys, make_plan, open_networks
from troupe_training.export.manifest import read_manifest
from troupe_training.export.motionbricks.examples import example_inputs
from troupe_training.models.motionbricks.config import PRESETS
from troupe_training.models.motionbricks.root_choice import envelope, moved
from troupe_training.models.motionbricks.root_module import RootModule
from troupe_training.models.motionbricks.served import RootStage
from troupe_training.train.checkpoints import Checkpoint, read_checkpoint
from troupe_training.train.motionbricks.choice import (
    CHOICE,
    choice_loss,
    chosen_root,
    energy_score,
    factor_likelihood,
    fitted_width,
    held_back,
    missed,
    observe,
    posterior,
    widen,
)
from troupe_training.train.motionbricks.masks import random_slot_masks, slot_frames
from troupe_training.train.motionbricks.pose import POSE
from troupe_training.train.motionbricks.root import ROOT, root_pass
from troupe_training.train.motionbricks.stages import train_stage

CONFIG = PRESETS["test"]


@pytest.fixture
def store(cache: Path) -> ClipStore:
    return ClipStore(cache, "train")


@pytest.fixture
def root(store: ClipStore) -> RootModule:
    return ROOT.build(CONFIG, store).eval().requires_grad_(False)


def random_factors(
    batch: int = 3, observed: int = 40, count: int = 5
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(1)
    rest = torch.rand(batch, observed, generator=generator) + 0.2
    factors = torch.randn(batch, observed, count, generator=generator)
    return torch.randn(batch, observed, generator=generator), factors, rest


def test_the_likelihood_is_that_of_a_normal_distribution_of_low_rank():
    observed, factors, rest = random_factors()
    expected = -LowRankMultivariateNormal(torch.zeros_like(rest), factors, rest).log_prob(observed)
    torch.testing.assert_close(factor_likelihood(observed, factors, rest), expected, rtol=1e-5, atol=1e-4)


def test_the_posterior_is_that_of_the_joint_normal_distribution():
    """Conditioning the dense covariance of (z, observed) gives the same mean and covariance."""
    observed, factors, rest = (x[0].double() for x in random_factors())
    covariance = factors @ factors.T + torch.diag(rest)
    gain = factors.T @ torch.linalg.inv(covariance)
    mean, lower = posterior(observed[None], factors[None], rest[None])
    torch.testing.assert_close(mean[0], gain @ observed)
    torch.testing.assert_close(torch.linalg.inv(lower[0] @ lower[0].T), torch.eye(5).double() - gain @ factors)


def test_the_energy_score_is_least_for_draws_of_the_true_width():
    spread = MultivariateNormal(torch.zeros(8), torch.eye(8))
    torch.manual_seed(2)
    observed, drawn = spread.sample((4000,)), spread.sample((4, 4000))
    scores = {width: float(energy_score(observed, width * drawn).mean()) for width in (0.5, 0.8, 1.0, 1.25, 2.0)}
    assert min(scores, key=lambda width: scores[width]) == 1.0


def test_missed_roots_take_predictions_to_the_truth(store: ClipStore):
    first, second = (store.batch(512, torch.Generator().manual_seed(seed), 32).global_root for seed in (1, 2))
    torch.testing.assert_close(moved(first, missed(first, second)), second, atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("frames", [12, 40, 64])
def test_given_frames_leave_no_choice(frames: int):
    """Zero at the context and at the given targets, wherever those lie; free between them and where nothing is given."""
    given = torch.ones(3, 8)
    given[0, 4:] = torch.tensor([0.0, 0.0, 0.0, 1.0])
    given[1, 4:] = torch.tensor([1.0, 0.0, 1.0, 0.0])
    given[2, 4:] = 0.0
    open_ = envelope(given, torch.full((3,), frames // 4))[:, :frames]
    assert (open_[:, :CONTEXT_FRAMES] == 0.0).all()
    targets = given[:, 4:] == 1.0
    assert (open_[:, -4:][targets] == 0.0).all() and (open_[:, -4:][~targets] > 0.05).all()
    assert (open_[:, CONTEXT_FRAMES:-4] > 0.05).all() and open_.max() <= 1.0
    assert (open_[2, CONTEXT_FRAMES:].diff() > 0.0).all(), "without a target the way opens ever more"


def test_drawn_roots_pass_through_what_is_given_and_zeros_change_nothing(store: ClipStore, root: RootModule):
    choice = CHOICE.build(CONFIG, store).eval()
    segments = store.batch(2048, torch.Generator().manual_seed(3), 32)
    batch = len(segments.pose)
    masks = random_slot_masks(batch, torch.Generator().manual_seed(4))
    given = root_pass(root, segments, masks, torch.ones(batch))[1]
    assert torch.equal(choice(given, torch.zeros(batch, choice.choices)), given.root)
    drawn = choice(given, torch.randn(batch, choice.choices))
    index = slot_frames(32)
    held = masks["global_root"] == 1.0
    assert torch.equal(drawn[:, index][held], given.root[:, index][held])
    assert ((drawn - given.root)[:, 8:26, :3].norm(dim=-1).amax(1) > 1e-3).all(), "between them they differ"
    torch.testing.assert_close(drawn[..., 3:].norm(dim=-1), given.root[..., 3:].norm(dim=-1))


def test_a_stage_with_a_choice_has_the_old_root_at_zero_bit_for_bit(store: ClipStore, root: RootModule):
    pose, choice = POSE.build(CONFIG, store), CHOICE.build(CONFIG, store).eval()
    inputs = example_inputs(store, pose, 6, 9, 3, CONFIG.root_choices)["root"]
    noise = inputs.pop("root_noise")
    plain, choosing = RootStage(root).eval(), RootStage(root, choice).eval()
    with torch.no_grad():
        for old, new in zip(plain(**inputs), choosing(**inputs, root_noise=torch.zeros_like(noise)), strict=True):
            assert torch.equal(old, new)
        assert not torch.equal(plain(**inputs)[2], choosing(**inputs, root_noise=noise)[2])


def test_it_learns_what_the_root_module_misses(cache: Path, store: ClipStore, tmp_path: Path):
    """After some updates misses are likelier, draws are about as far apart as they are off, and posterior draws lie near."""
    assert train_stage("root", job(cache, tmp_path, 60), "test")
    before = (tmp_path / "root.pt").read_bytes()
    assert train_stage("choice", job(cache, tmp_path, 240), "test")
    assert (tmp_path / "root.pt").read_bytes() == before, "the root module stays"
    root, choice = ROOT.load(tmp_path, store), CHOICE.load(tmp_path, store)
    fresh = CHOICE.build(CONFIG, store).eval()
    segments = store.batch(4096, torch.Generator().manual_seed(5), 32)
    masks = {name: torch.ones(len(segments.pose), 8) for name in ("local_root", "global_root", "pose")}
    for mask in masks.values():
        mask[:, 4:7] = 0.0
    given = root_pass(root, segments, masks, torch.ones(len(segments.pose)))[1]
    likelihoods = [factor_likelihood(*observe(c, given, segments)[:3]).mean() for c in (fresh, choice)]
    assert likelihoods[1] < likelihoods[0]
    generator = torch.Generator().manual_seed(6)
    draws = [choice(given, torch.randn(len(segments.pose), 16, generator=generator))[:, :32] for _ in range(2)]

    def apart(a: torch.Tensor, b: torch.Tensor) -> float:
        return float((a - b)[:, 4:31, :3].norm(dim=-1).mean())

    assert 0.6 < apart(*draws) / apart(draws[0], segments.global_root) < 1.5
    near = chosen_root(choice, given, segments, generator)
    assert apart(near, segments.global_root) < 0.6 * apart(given.root[:, :32], segments.global_root)


def test_held_back_files_only_say_how_wide_curves_are(store: ClipStore, root: RootModule):
    files = held_back(store)
    assert 4 <= len(files) < len(store.clips) / 3 and files == held_back(store)
    choice = CHOICE.build(CONFIG, store)
    terms = choice_loss(store, 512, root)(choice, torch.Generator().manual_seed(7), 0.0)
    assert terms["likelihood"].requires_grad and not terms["_held_back"].requires_grad
    assert set(choice_loss(store, 512, root)(choice, torch.Generator().manual_seed(7), 0.9)) >= {"likelihood", "score"}
    # An untrained root module misses its way by far: more than one step of the widest is needed.
    widths = []
    for _ in range(6):
        widths.append(fitted_width(choice.eval(), store, 512, root, 1))
        state: Checkpoint = {
            "stage": "choice",
            "meta": {},
            "model": {},
            "average": choice.state_dict(),
            "step": 0,
            "seconds": 0.0,
            "history": [],
        }
        choice.load_state_dict(widen(state, widths[-1])["average"])
    assert widths[0] > 1.2 and widths[-1] == pytest.approx(1.0, abs=0.06)


def test_a_choice_goes_into_a_pack_and_back(cache: Path, store: ClipStore, tmp_path: Path):
    run, common = tmp_path / "run", ["--cache", str(cache)]
    for stage in ("tokenizer", "root", "pose", "choice"):
        argv = ["train", stage, "--run", str(run), "--preset", "test", "--steps", "12", "--frames-per-step", "512"]
        assert main([*argv, *common]) == 0
    assert main(["export", "--run", str(run), "--out", str(tmp_path / "pack"), *common]) == 0
    manifest = read_manifest(tmp_path / "pack")
    assert manifest["root_choices"] == 16 and manifest["training"]["choice_steps"] == 12
    names = [i.name for i in onnx.load(tmp_path / "pack" / "root.onnx").graph.input]
    assert names[-2:] == ["count_noise", "root_noise"]
    assert (
        main(["adopt", "--pack", str(tmp_path / "pack"), "--run", str(tmp_path / "again"), "--preset", "test", *common])
        == 0
    )
    assert read_checkpoint(tmp_path / "again" / "choice.pt")["meta"]["adopted"]
    # Run, pack and what was adopted draw the same roots.
    segments = store.batch(512, torch.Generator().manual_seed(8), 32)
    keys, plans = Keys.of(segments, 32), {}
    for folder in ("run", "pack", "again"):
        networks = open_networks(tmp_path / folder, store, 1)
        assert networks.root_choices == 16
        plans[folder] = [
            make_plan(networks, keys, 32, s).global_root for s in (Sampling(), Sampling(1, 1.0, 3), Sampling(1, 1.0, 4))
        ]
    for folder in ("pack", "again"):
        for one, other in zip(plans["run"], plans[folder], strict=True):
            torch.testing.assert_close(one, other, atol=2e-3, rtol=0.0)
    likeliest, drawn, other = plans["pack"]
    assert (likeliest - drawn).abs().max() > 1e-2 and (drawn - other).abs().max() > 1e-2
    # Without the stage nothing of it is there.
    (run / "choice.pt").unlink()
    assert main(["export", "--run", str(run), "--out", str(tmp_path / "plain"), *common]) == 0
    assert "root_choices" not in read_manifest(tmp_path / "plain")
    assert [i.name for i in onnx.load(tmp_path / "plain" / "root.onnx").graph.input][-1] == "count_noise"
    networks = open_networks(tmp_path / "plain", store, 1)
    same = [make_plan(networks, keys, 32, Sampling(1, 1.0, seed)).global_root for seed in (3, 4)]
    assert torch.equal(*same)
    torch.testing.assert_close(same[0], likeliest, atol=1e-5, rtol=0.0)
