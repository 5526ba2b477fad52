"""Best of several draws."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from troupe_training.data.store import ClipStore
from troupe_training.models.motionbricks.config import PRESETS
from troupe_training.train.motionbricks.choice import CHOICE
from troupe_training.train.motionbricks.draws import best_tokens, drawn_tokens, nearest_draws, slot_errors
from troupe_training.train.motionbricks.losses import Body
from troupe_training.train.motionbricks.pose import POSE
from troupe_training.train.motionbricks.refine import Guides, refine_loss, request_task, tokens_of
from troupe_training.train.motionbricks.root import ROOT
from troupe_training.train.motionbricks.tokenizer import REFINE

CONFIG = PRESETS["test"]


@pytest.fixture
def store(cache: Path) -> ClipStore:
    return ClipStore(cache, "train")


def test_each_slot_takes_its_own_nearest_draw():
    tokens = torch.arange(3 * 2 * 4 * 2).reshape(3, 2, 4, 2)
    errors = torch.ones(3, 2, 4)
    wanted = torch.tensor([[0, 2, 1, 2], [1, 1, 0, 2]])
    errors.scatter_(0, wanted[None], 0.5)
    found = nearest_draws(errors, tokens)
    for row in range(2):
        for slot in range(4):
            assert torch.equal(found[row, slot], tokens[wanted[row, slot], row, slot])


def test_draws_follow_the_chances():
    logits = torch.log(torch.tensor([0.7, 0.2, 0.1])).expand(1, 1, 1, 3)
    drawn = drawn_tokens(logits, 4000, torch.Generator().manual_seed(1)).flatten()
    shares = torch.bincount(drawn, minlength=3) / 4000
    torch.testing.assert_close(shares, torch.tensor([0.7, 0.2, 0.1]), atol=0.03, rtol=0.0)


def test_the_best_of_many_draws_lies_nearer_to_what_was_captured(store: ClipStore):
    tokenizer, body = REFINE.build(CONFIG, store).eval(), Body(store.skeleton)
    generator = torch.Generator().manual_seed(2)
    segments = store.batch(1024, generator, 32)
    mask = torch.zeros(len(segments.pose), 32)
    mask[:, :4] = 1.0
    logits = torch.zeros(len(segments.pose), 8, CONFIG.heads, CONFIG.codes)
    given = (segments.global_root, segments.pose, mask)

    def off(draws: int) -> float:
        tokens = best_tokens(
            tokenizer, logits, draws, given, segments.positions, body, torch.Generator().manual_seed(3)
        )
        out = tokenizer.decoder(tokenizer.quantizer.embed(tokens), *given)
        return float(slot_errors(out, segments.positions, body).mean())

    with torch.no_grad():
        assert off(12) < off(1)


def test_a_share_of_the_samples_keeps_the_likeliest_tokens_and_roots(store: ClipStore):
    pose, root, tokenizer, choice = (stage.build(CONFIG, store).eval() for stage in (POSE, ROOT, REFINE, CHOICE))
    body = Body(store.skeleton)
    guides = Guides(pose, root, 0.0, 4, choice)
    with torch.no_grad():
        task = request_task(store, 2048, guides, torch.Generator().manual_seed(4))
        drawn = task.drawn[:, 0, 0]
        assert drawn.any() and not drawn.all()
        found = tokens_of(tokenizer, guides, task, body, torch.Generator().manual_seed(5))
        likeliest = tokens_of(
            tokenizer,
            Guides(pose, root, 0.0, 0),
            replace(task, drawn=torch.zeros_like(task.drawn)),
            body,
            torch.Generator().manual_seed(5),
        )
    assert torch.equal(found[~drawn], likeliest[~drawn])
    assert (found[drawn] != likeliest[drawn]).flatten(1).any(1).all()
    plain = request_task(store, 2048, Guides(pose, root, 0.0, 0), torch.Generator().manual_seed(4))
    assert not plain.drawn.any()
    terms = refine_loss(store, 512, guides)(tokenizer, torch.Generator().manual_seed(6), 0.0)
    assert all(torch.isfinite(term) for term in terms.values())
