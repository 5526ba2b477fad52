"""The networks: padding, masking, quantisation, timing, and that they learn."""

import signal
from pathlib import Path

import pytest
import torch
from torch.nn import functional as F

from tests_support import job
from troupe_training.data.conventions import MAX_FRAMES
from troupe_training.data.kinematics import Kinematics
from troupe_training.data.rotations import six_d_to_matrix
from troupe_training.data.store import ClipStore
from troupe_training.models.layers import FrameConv, UnrolledConv, unroll_convolutions
from troupe_training.models.motionbricks.config import COUNTS, MAX_TOKENS, PRESETS, SLOTS
from troupe_training.models.motionbricks.quantizers import MultiHeadQuantizer
from troupe_training.models.motionbricks.root_module import RootModule, baseline_trajectory
from troupe_training.models.motionbricks.served import DecoderStage, RootStage
from troupe_training.train.checkpoints import read_checkpoint
from troupe_training.train.motionbricks.masks import random_slot_masks, slot_frames
from troupe_training.train.motionbricks.pose import POSE
from troupe_training.train.motionbricks.root import ROOT, root_loss, run_root
from troupe_training.train.motionbricks.stages import train_stage
from troupe_training.train.motionbricks.tokenizer import TOKENIZER

CONFIG = PRESETS["test"]


@pytest.fixture
def store(cache: Path) -> ClipStore:
    return ClipStore(cache, "train")


def pad(x: torch.Tensor, length: int, fill: float) -> torch.Tensor:
    rest = torch.full((x.shape[0], length - x.shape[1], *x.shape[2:]), fill, dtype=x.dtype)
    return torch.cat([x, rest], 1)


@pytest.mark.parametrize("tokens", [3, 7, 15])
def test_padding_changes_nothing(store: ClipStore, tokens: int):
    """A segment decodes the same alone and padded to 64 frames with rubbish."""
    tokenizer, pose = TOKENIZER.build(CONFIG, store).eval(), POSE.build(CONFIG, store).eval()
    segments = store.batch(400, torch.Generator().manual_seed(1), 4 * tokens)
    batch, frames = segments.pose.shape[:2]
    mask = torch.zeros(batch, frames)
    mask[:, [0, 1, 2, 3, frames - 1]] = 1.0
    chosen = torch.randint(CONFIG.codes, (batch, tokens, CONFIG.heads))
    count = torch.full((batch,), tokens)
    alone = tokenizer.decoder(tokenizer.quantizer.embed(chosen), segments.global_root, segments.pose, mask)
    long = [pad(x, MAX_FRAMES, 0.7) for x in (segments.global_root, segments.pose, mask)]
    padded = tokenizer.decoder(tokenizer.quantizer.embed(pad(chosen, MAX_TOKENS, 1)), *long, count)
    for name in ("positions", "rotations", "local_root", "global_root", "contact_logits"):
        assert torch.allclose(getattr(padded, name)[:, :frames], getattr(alone, name), atol=2e-5), name
    logits = pose(chosen, count, segments.global_root, segments.pose, mask)
    padded_logits = pose(pad(chosen, MAX_TOKENS, 0), count, *long)
    assert torch.allclose(padded_logits[:, :tokens], logits, atol=2e-5)


@pytest.mark.parametrize("kernel", [3, 5, 7])
def test_an_unrolled_convolution_is_the_convolution(kernel: int):
    stack = torch.nn.Sequential(FrameConv(6, kernel))
    x = torch.randn(3, 5, 6)
    expected = F.conv1d(x.mT, stack[0].weight, stack[0].bias, padding=kernel // 2).mT
    assert torch.allclose(stack(x), expected, atol=1e-5)
    unroll_convolutions(stack)
    assert isinstance(stack[0], UnrolledConv)
    assert torch.allclose(stack(x), expected, atol=1e-5)


def test_the_decoder_stage_reads_out_what_the_decoder_gives(store: ClipStore):
    tokenizer = TOKENIZER.build(CONFIG, store).eval()
    segments = store.batch(400, torch.Generator().manual_seed(2), 24)
    batch, frames = segments.pose.shape[:2]
    mask = torch.zeros(batch, frames)
    mask[:, [0, 1, 2, 3, frames - 1]] = 1.0
    chosen = torch.randint(CONFIG.codes, (batch, 6, CONFIG.heads))
    inputs = (segments.global_root, segments.pose, mask)
    whole = tokenizer.decoder(tokenizer.quantizer.embed(chosen), *inputs)
    rotations, root, contacts = DecoderStage(tokenizer)(chosen, torch.full((batch,), 6), *inputs)
    assert torch.allclose(six_d_to_matrix(rotations), whole.rotations, atol=1e-5)
    assert torch.allclose(root, whole.global_root, atol=1e-5)
    assert torch.allclose(contacts, torch.sigmoid(whole.contact_logits), atol=1e-5)


def test_quantizer_finds_its_own_codes():
    quantizer = MultiHeadQuantizer(CONFIG).eval()
    tokens = torch.randint(CONFIG.codes, (5, 6, CONFIG.heads))
    assert torch.equal(quantizer.tokens(quantizer.embed(tokens)), tokens)


def test_quantizer_revives_dead_codes():
    torch.manual_seed(0)
    quantizer = MultiHeadQuantizer(CONFIG, decay=0.5).train()
    latent = torch.randn(64, 16, CONFIG.heads * CONFIG.code_dim)
    for _ in range(30):
        _, tokens, _ = quantizer(latent)
    used = [len(tokens[..., head].unique()) for head in range(CONFIG.heads)]
    assert min(used) >= CONFIG.codes - 1


def test_baseline_goes_through_the_given_target_and_keeps_the_context():
    global_root = torch.zeros(2, SLOTS, 5)
    global_root[..., 3] = 1.0
    global_root[:, :4, 2] = torch.tensor([-0.3, -0.2, -0.1, 0.0])
    global_root[:, 6, 2] = 2.0
    local_root = torch.zeros(2, SLOTS, 4)
    local_root[:, :4, 1] = 3.0
    has = torch.zeros(2, SLOTS)
    has[:, :4] = 1.0
    has[0, 6] = 1.0
    base = baseline_trajectory(local_root, global_root, has, torch.tensor([8, 8]))
    assert torch.allclose(base[0, 30, 2], torch.tensor(2.0), atol=1e-5)
    assert torch.allclose(base[:, :4, 2], global_root[:, :4, 2])
    assert 0.09 < base[1, 4, 2] < 0.11
    assert base[1, -1, 2] < 3.0 * 0.5 + 0.01  # the velocity fades out


def test_root_stage_obeys_allowed_counts(store: ClipStore):
    stage = RootStage(ROOT.build(CONFIG, store).eval())
    batch = 6
    zeros = [torch.zeros(batch, SLOTS, w) for w in (4, 5, store.skeleton.joint_count * 9)]
    has = torch.ones(batch, SLOTS)
    allowed = torch.zeros(batch, COUNTS)
    for row in range(batch):
        allowed[row, [row, row + 5]] = 1.0
    count, probabilities, root = stage(*zeros, has, has, has, allowed, torch.randn(batch, COUNTS) * 5)
    assert (allowed[torch.arange(batch), count - 3] == 1).all()
    assert probabilities[allowed == 0].max() < 1e-6
    assert torch.allclose(probabilities.sum(-1), torch.ones(batch), atol=1e-5)
    assert root.shape == (batch, MAX_FRAMES, 5)


def test_stages_learn_resume_and_chain(cache: Path, tmp_path: Path, store: ClipStore):
    """Every stage's loss falls, a second call goes on from the checkpoint, and each stage feeds the next."""
    histories = {}
    for stage, steps in (("tokenizer", 150), ("root", 150), ("pose", 100), ("refine", 50)):
        assert train_stage(stage, job(cache, tmp_path, steps // 2), "test")
        assert train_stage(stage, job(cache, tmp_path, steps), "test")
        state = read_checkpoint(tmp_path / f"{stage}.pt")
        assert state["step"] == steps
        histories[stage] = [h["total"] for h in state["history"]]
    # It begins well, with keyframes carried over.
    assert histories["tokenizer"][-1] < 0.85 * histories["tokenizer"][0]
    assert histories["root"][-1] < 0.8 * histories["root"][0]
    assert histories["pose"][-1] < histories["pose"][0]

    root = ROOT.load(tmp_path, store)
    segments = store.batch(1024, torch.Generator().manual_seed(9), 40)
    masks = random_slot_masks(len(segments.pose), torch.Generator().manual_seed(9))
    masks = {name: torch.ones_like(mask) for name, mask in masks.items()}
    with torch.no_grad():
        trajectory = run_root(root, segments, masks, torch.ones(len(segments.pose)))[1]
    error = (trajectory - segments.global_root)[..., [0, 2]].abs()
    assert error[:, slot_frames(40)].mean() < 0.05


def test_a_stopped_run_keeps_its_checkpoint_and_goes_on(cache: Path, tmp_path: Path, store: ClipStore):
    """SIGTERM in the middle: the call says that it is not done, the same call finishes the budget."""
    loss = root_loss(store, 512)

    def stopped(model: RootModule, generator: torch.Generator, progress: float) -> dict[str, torch.Tensor]:
        if progress > 0.0:  # in the second update
            signal.raise_signal(signal.SIGTERM)
        return loss(model, generator, progress)

    root = ROOT.build(CONFIG, store)
    assert not job(cache, tmp_path, 40, 512).fit("root", root, {}, stopped)
    assert read_checkpoint(tmp_path / "root.pt")["step"] == 2
    assert job(cache, tmp_path, 7, 512).fit("root", root, {}, loss)
    assert read_checkpoint(tmp_path / "root.pt")["step"] == 7


def test_autocast_leaves_geometry_exact(store: ClipStore):
    """Metres survive mixed precision: segments, kinematics and the read-outs run in 32 bits."""
    kinematics = Kinematics(store.skeleton)
    plain = store.batch(512, torch.Generator().manual_seed(4), 36)
    with torch.autocast("cpu", torch.bfloat16):
        mixed = store.batch(512, torch.Generator().manual_seed(4), 36)
        shown = kinematics.positions(six_d_to_matrix(mixed.six_d))
    assert torch.equal(plain.positions, mixed.positions) and torch.equal(plain.six_d, mixed.six_d)
    assert torch.allclose(shown, kinematics.positions(six_d_to_matrix(plain.six_d)), atol=1e-6)
