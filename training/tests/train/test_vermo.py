"""VerMo's training: every stage begins, goes on and is exported; messages are what a server would write."""

import random
import tomllib
from pathlib import Path

import pytest
import torch

from troupe_training.cli.main import main
from troupe_training.models.vermo.config import MAX_TOKENS
from troupe_training.models.vermo.messages import EOS, REPLY, Vocabulary
from troupe_training.models.vermo.pieces import Pieces
from troupe_training.train.checkpoints import read_checkpoint
from troupe_training.train.vermo.corpus import SHARES, MessageSource, message_batches
from troupe_training.train.vermo.language import collate, motions_of


@pytest.fixture(scope="module")
def source(vermo_run: Path, cache: Path) -> MessageSource:
    return MessageSource(
        motions_of(vermo_run, cache, "train"), Pieces.read(vermo_run / "pieces.json"), SHARES, agents=0.3
    )


def test_messages_fit_and_are_whole(source: MessageSource):
    vocabulary = Vocabulary(source.pieces.count, 4375, 0, MAX_TOKENS)
    rng, seen = random.Random(1), set()
    for _ in range(150):
        message = source.message(rng)
        seen.add((message.task, len(message.reply)))
        prompt, answer = message.prompt(vocabulary), message.answer(vocabulary)
        assert len(prompt) + len(answer) <= 128
        assert prompt[-1] == REPLY and answer[-1] == EOS
        if message.length is not None:
            assert all(len(codes) == message.length for codes in message.reply)
        assert all(len(codes) >= 1 for codes in message.reply)
    assert {task for task, _ in seen} == set(SHARES)
    assert ("text_to_motion", 2) in seen and ("text_to_motion", 1) in seen


def test_a_condition_is_encoded_without_what_it_leads_to(source: MessageSource):
    rng = random.Random(2)
    message = next(m for m in iter(lambda: source.message(rng), None) if m.task == "prediction" and len(m.reply) == 1)
    run = message.condition[0][0]
    key = next(key for key, codes in source.motions._codes.items() if codes is run)
    crop = source.motions.store.segments(torch.tensor([key[0]]), 4 * len(run))
    assert source.motions.tokenizer is not None
    assert source.motions.tokenizer.encode(crop.pose, crop.global_root)[0].tolist() == run


def test_only_replies_count_after_the_first_stage(source: MessageSource):
    vocabulary = Vocabulary(source.pieces.count, 4375, 0, MAX_TOKENS)
    rng = random.Random(3)
    messages = [source.message(rng) for _ in range(8)]
    replies, everything = (collate(messages, vocabulary, whole) for whole in (False, True))
    for row, message in enumerate(messages):
        answer, prompt = message.answer(vocabulary), message.prompt(vocabulary)
        assert replies.tokens[row, 1:][replies.counted[row]].tolist() == answer
        assert everything.tokens[row, 1:][everything.counted[row]].tolist() == prompt[1:] + answer
    lengths = [len(m.prompt(vocabulary)) for m in messages]
    groups = message_batches(messages, lengths, 100)
    assert sorted(i for group in groups for i in group) == list(range(8))
    assert all(len(group) == 1 or len(group) * max(lengths[i] for i in group) <= 100 for group in groups)


def test_stages_build_on_each_other_and_note_their_validation(vermo_run: Path):
    best = read_checkpoint(vermo_run / "language-instruct-best.pt")
    assert best["meta"]["validations"][0]["total"] > 0.0
    assert (vermo_run / "language-specialist-prediction.pt").exists()


def test_validation_clips_are_not_trained_on(vermo_run: Path, cache: Path):
    kept, trained = (
        {clip["name"] for clip in motions_of(vermo_run, cache, split).clips} for split in ("validation", "train")
    )
    assert kept and trained and not kept & trained


def test_a_run_becomes_a_pack(vermo_run: Path, cache: Path, tmp_path: Path):
    out = tmp_path / "pack"
    assert (
        main(
            [
                "vermo",
                "export",
                "--run",
                str(vermo_run),
                "--cache",
                str(cache),
                "--out",
                str(out),
                "--licence",
                "CC0 1.0",
            ]
        )
        == 0
    )
    manifest = tomllib.loads((out / "pack.toml").read_text())
    assert manifest["vermo"]["tasks"] == list(SHARES) and manifest["vermo"]["audio_codes"] == 0
    assert manifest["training"]["language_instruct_steps"] == 2
    assert manifest["vermo"]["flow_steps"] == 28 and manifest["capabilities"]["agents"]
