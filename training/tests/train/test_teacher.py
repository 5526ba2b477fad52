"""A small pack that learns from a large one speaks its tokens, and aims between it and the truth."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from tests_support import job
from troupe_training.data.store import ClipStore
from troupe_training.models.motionbricks import config
from troupe_training.models.motionbricks.served import Networks
from troupe_training.train.motionbricks.pose import POSE, pose_loss
from troupe_training.train.motionbricks.root import ROOT, root_loss
from troupe_training.train.motionbricks.stages import STAGES, train_stage
from troupe_training.train.motionbricks.teacher import lend_tokens, soft_target, taught_entropy
from troupe_training.train.motionbricks.tokenizer import ENCODER, REFINE, TOKENIZER, tokenizer_loss

LARGE = config.PRESETS["test"]
SMALL = replace(LARGE, decoder_channels=(16, 16, 16), root_dim=16, pose_dim=16, attention_head_dim=8)


@pytest.fixture
def store(cache: Path) -> ClipStore:
    return ClipStore(cache, "train")


def teacher_of(store: ClipStore) -> Networks:
    return Networks(*(stage.build(LARGE, store).eval() for stage in (TOKENIZER, ROOT, POSE)))


def test_the_aim_lies_between_truth_and_teacher():
    truth, taught = torch.zeros(3), torch.ones(3)
    assert torch.equal(soft_target(truth, taught, 0.25), torch.full((3,), 0.25))


def test_entropy_is_least_where_student_and_teacher_agree():
    taught = torch.tensor([[2.0, 0.0, -1.0]])
    agrees = taught_entropy(taught, taught)
    for other in ([0.0, 2.0, -1.0], [4.0, 0.0, -1.0], [0.0, 0.0, 0.0]):
        assert taught_entropy(torch.tensor([other]), taught) > agrees


def test_the_student_has_the_teachers_tokens_and_learns_its_decoder_alone(store: ClipStore):
    teacher = teacher_of(store)
    student = TOKENIZER.build(SMALL, store)
    lend_tokens(teacher.tokenizer, student)
    pose = store.batch(400, torch.Generator().manual_seed(1), 24).pose
    tokens = [t.quantizer.tokens(t.encode(pose)) for t in (student.eval(), teacher.tokenizer)]
    assert torch.equal(*tokens)
    student.train()
    book = student.quantizer.book.clone()
    terms = tokenizer_loss(store, 400, taught=True)(student, torch.Generator().manual_seed(2), 0.0)
    sum(value for name, value in terms.items() if not name.startswith("_")).backward()
    assert torch.equal(student.quantizer.book, book)
    assert all(p.grad is None for p in student.encoder.parameters())
    assert any(p.grad.abs().max() > 0 for p in student.decoder.parameters() if p.grad is not None)


def test_tokens_of_another_size_are_refused(store: ClipStore):
    with pytest.raises(SystemExit, match="other sizes"):
        lend_tokens(teacher_of(store).tokenizer, TOKENIZER.build(replace(SMALL, codes=8), store))


def test_losses_take_the_teachers_word(store: ClipStore):
    teacher = teacher_of(store)
    root, pose = ROOT.build(SMALL, store), POSE.build(SMALL, store)
    alone = root_loss(store, 400)(root, torch.Generator().manual_seed(3), 0.0)
    taught = root_loss(store, 400, teacher.root)(root, torch.Generator().manual_seed(3), 0.0)
    assert alone["position"] != taught["position"] and alone["count"] == taught["count"]
    losses = [
        pose_loss(store, 400, teacher.tokenizer, teacher.root, of)(pose, torch.Generator().manual_seed(3), 0.0)
        for of in (None, teacher.pose)
    ]
    assert losses[0]["entropy"] != losses[1]["entropy"]


def test_every_stage_trains_under_a_teacher(cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(config.PRESETS, "test-small", SMALL)
    large, small = tmp_path / "large", tmp_path / "small"
    for run, preset, teacher in ((large, "test", None), (small, "test-small", large)):
        for stage in (name for name in STAGES if name != ENCODER.name):  # that one is for adopted runs
            assert train_stage(stage, job(cache, run, 2, 300), preset, teacher)
    store = ClipStore(cache, "train")
    assert REFINE.load(small, store).config == SMALL
    assert POSE.load(small, store).place.shape[1] == 16
