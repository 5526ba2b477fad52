"""VerMo's networks and messages: frames, codes, reach, masks, sampling, and a cache that changes nothing."""

from dataclasses import replace

import pytest
import torch

from troupe_training.data.rotations import matrix_to_six_d, six_d_to_matrix
from troupe_training.data.skeleton import Skeleton
from troupe_training.models.vermo.config import DECODER_REACH, PRESETS, RATE
from troupe_training.models.vermo.flow import FlowDecoder, flow_sample
from troupe_training.models.vermo.frames import Body, features, from_first, state_of, world_joints
from troupe_training.models.vermo.language import LanguageModel, Served
from troupe_training.models.vermo.messages import (
    AGENT_SEP,
    BOS,
    CONDITION,
    EOS,
    GAP,
    INSTRUCTION,
    REPLY,
    SPECIALS,
    Message,
    Rules,
    Vocabulary,
)
from troupe_training.models.vermo.pieces import Pieces, train_pieces, words_of
from troupe_training.models.vermo.sampler import Asked, Sampling, replies
from troupe_training.models.vermo.tokenizer import Tokenizer

SKELETON = Skeleton(
    names=["Hips", "Spine", "Leg"],
    parents=[-1, 0, 0],
    offsets=[[0.0, 0, 0], [0.0, 0.5, 0], [0.1, -0.8, 0]],
    left_axis=[1.0, 0, 0],
)
TINY = PRESETS["tiny"]
VOCABULARY = Vocabulary(text_pieces=30, motion_codes=TINY.tokenizer.codes, audio_codes=5, max_tokens=8)


def motion(batch: int, frames: int, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    """Pose features and roots anywhere, with any heading."""
    generator = torch.Generator().manual_seed(seed)
    six_d = torch.randn(batch, 1, 18, generator=generator) + 0.1 * torch.randn(batch, frames, 18, generator=generator)
    rotations = six_d_to_matrix(six_d.unflatten(-1, (3, 6)))
    psi = torch.randn(batch, frames, generator=generator).cumsum(1) * 0.1 + 2.0
    place = torch.randn(batch, frames, 3, generator=generator).cumsum(1) * 0.05 + 3.0
    root = torch.cat([place, torch.cos(psi)[..., None], torch.sin(psi)[..., None]], -1)
    positions = Body(SKELETON).positions(rotations, root[..., 1])
    return torch.cat([positions, matrix_to_six_d(rotations)], -1).flatten(2), root


def turned_about(pose: torch.Tensor, root: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """The same motion elsewhere, a quarter turn to the left."""
    vectors = pose.unflatten(-1, (-1, 3))
    pose = torch.stack([vectors[..., 2], vectors[..., 1], -vectors[..., 0]], -1).flatten(2)
    x, y, z, c, s = root.unbind(-1)
    return pose, torch.stack([z + 5.0, y, -x - 2.0, -s, c], -1)


def test_frames_come_back_from_their_states():
    pose, root = motion(2, 24)
    shown, shown_root = Body(SKELETON).frames(state_of(features(pose, root)))
    assert torch.allclose(shown_root, from_first(root), atol=1e-4)
    distances = [
        torch.cdist(world_joints(p, r)[:, 0], world_joints(p, r)[:, -1]) for p, r in ((pose, root), (shown, shown_root))
    ]
    assert torch.allclose(*distances, atol=1e-4)


def test_tokens_do_not_depend_on_place_and_heading():
    torch.manual_seed(1)
    tokenizer = Tokenizer(TINY.tokenizer, SKELETON).eval()
    pose, root = motion(3, 32)
    elsewhere = turned_about(pose, root)
    assert torch.allclose(features(pose, root), features(*elsewhere), atol=1e-4)
    tokens = tokenizer.encode(pose, root)
    assert tokens.shape == (3, 8) and 0 <= int(tokens.min()) <= int(tokens.max()) < TINY.tokenizer.codes
    assert (tokens == tokenizer.encode(*elsewhere)).float().mean() > 0.95


def test_codes_are_levels_and_back():
    tokenizer = Tokenizer(TINY.tokenizer, SKELETON)
    codes = torch.arange(TINY.tokenizer.codes)[None]
    levels = tokenizer.embed(codes)
    assert levels.shape == (1, 4375, 5) and float(levels.abs().max()) == 1.0
    assert len(torch.unique(levels[0], dim=0)) == 4375
    bounded = torch.atanh((levels * 0.999).clamp(-0.999, 0.999))
    assert (tokenizer.quantizer.tokens(bounded)[..., 0] == codes).all()


def test_a_codebook_gives_the_nearest_of_as_many_codes_and_follows_the_latents():
    torch.manual_seed(1)
    config = replace(TINY.tokenizer, quantizer="vq")
    tokenizer = Tokenizer(config, SKELETON).train()
    pose, root = motion(4, 64)
    latent = tokenizer.latent(pose, root).detach()
    assert latent.shape == (4, 16, config.book_dim) and config.codes == TINY.tokenizer.codes
    before = torch.cdist(latent.flatten(0, 1), tokenizer.embed(tokenizer.encode(pose, root)).flatten(0, 1)).diagonal()
    for _ in range(3):
        tokenizer.quantizer(latent)
    tokens = tokenizer.encode(pose, root)
    distance = torch.cdist(latent.flatten(0, 1), tokenizer.quantizer.book[0])
    chosen = distance.gather(1, tokens.flatten()[:, None])[:, 0]  # codes that begin with the same latent are as near
    assert torch.allclose(chosen, distance.min(-1).values, atol=1e-3)
    assert float(chosen.mean()) < 0.5 * float(before.mean())
    shown, shown_root = tokenizer.decode(tokens)
    assert shown.shape == pose.shape and shown_root.shape == root.shape


def test_a_frame_depends_on_two_tokens_either_side_and_no_more():
    torch.manual_seed(2)
    tokenizer = Tokenizer(TINY.tokenizer, SKELETON).eval()
    codes = torch.randint(4375, (1, 12))
    other = codes.clone()
    other[0, 6] = (other[0, 6] + 2187) % 4375
    changed = (tokenizer.state(tokenizer.embed(codes)) != tokenizer.state(tokenizer.embed(other))).any(-1)[0]
    frames = torch.nonzero(changed)[:, 0]
    assert int(frames.min()) // RATE == 6 - DECODER_REACH
    assert int(frames.max()) // RATE == 6 + DECODER_REACH


def test_a_message_is_written_in_the_order_of_the_contract():
    v = VOCABULARY
    assert len(SPECIALS) == 18 and v.first_text == 26 and v.first_motion == 56 and v.size == 56 + 4375 + 5
    two = Message("inbetween", [[1], [2]], [[[3], [4]], [[5], [6]]], length=2, reply=[[7], [8]])
    task, m = v.task("inbetween"), v.first_motion
    assert two.prompt(v) == [
        *(BOS, task, INSTRUCTION, 27, AGENT_SEP, 28, CONDITION),
        *(m + 3, GAP, m + 4, AGENT_SEP, m + 5, GAP, m + 6, v.length(2), REPLY),
    ]
    assert two.answer(v) == [m + 7, AGENT_SEP, m + 8, EOS]
    assert Message("motion_to_text", condition=[[[0]]], reply=[[29]]).answer(v) == [v.first_motion - 1, EOS]
    assert Message("music_to_dance", condition=[[[4]]]).prompt(v)[-2] == v.size - 1
    with pytest.raises(ValueError, match="motion: codes must be from 0 to 4374"):
        Message("unconditional", reply=[[4375]]).answer(v)


def test_masks_hold_a_reply_to_its_kind_and_length():
    v = VOCABULARY
    motion_ids, text_ids = set(range(*v.span("motion"))), set(range(*v.span("text")))

    def allowed(rules: Rules, reply: list[int], prompt: int = 5) -> set[int]:
        return set(torch.nonzero(rules.allowed(v, prompt, reply))[:, 0].tolist())

    m = v.first_motion
    free = Rules("text_to_motion", 2, 4, 128)
    assert allowed(free, [m]) == motion_ids
    assert allowed(free, [m, m]) == motion_ids | {EOS}
    assert allowed(free, [m] * 4) == {EOS}
    fixed = Rules("text_to_motion", 2, 8, 128, length=3)
    assert allowed(fixed, [m, m]) == motion_ids and allowed(fixed, [m, m, m]) == {EOS}
    two = Rules("prediction", 1, 2, 128, agents=2)
    assert allowed(two, [m]) == motion_ids | {AGENT_SEP}
    assert allowed(two, [m, m]) == {AGENT_SEP}
    assert allowed(two, [m, AGENT_SEP]) == motion_ids
    assert allowed(two, [m, AGENT_SEP, m]) == motion_ids | {EOS}
    spoken = Rules("motion_to_text", 2, 8, 12)
    assert allowed(spoken, []) == text_ids and allowed(spoken, [v.first_text]) == text_ids | {EOS}
    assert allowed(spoken, [v.first_text] * 6) == {EOS}  # the twelfth position


def test_pieces_write_any_word_and_no_marks():
    captions = ["a person walks angrily", "someone waves the left hand", "a person waves"]
    pieces = Pieces(train_pieces(captions, 80))
    assert pieces.count <= 80
    for text in captions:
        assert pieces.text(pieces.ids(text)) == text
    assert pieces.text(pieces.ids("  A PERSON, that's Zig-zagging… ")) == "a person thats zig zagging"
    assert max(pieces.ids("quixotic 42")) < pieces.count
    assert len({tuple(pieces.varied().ids(captions[0])) for _ in range(30)}) > 1
    assert words_of(captions)[:3] == ["a", "angrily", "hand"]


def language(seed: int = 3) -> LanguageModel:
    torch.manual_seed(seed)
    model = LanguageModel(TINY.language, VOCABULARY, TINY.tokenizer.levels).eval()
    with torch.no_grad():
        for weight in model.parameters():
            weight.mul_(8.0 if weight.dim() == 2 else 1.0)
    return model


@torch.no_grad()
def test_cached_logits_are_those_without_a_cache():
    model, config = language(), TINY.language
    served = Served(model)
    tokens = torch.randint(VOCABULARY.size, (3, 14))
    expected = model(tokens)
    counts = torch.tensor([5, 9, 2])
    logits, columns = served(tokens[:, :9], counts, torch.zeros(3, dtype=torch.long), torch.zeros(3, 2, 2, 2, 1, 8))
    assert torch.allclose(logits, expected[torch.arange(3), counts - 1], atol=1e-4)
    cache = torch.randn(
        3, config.layers, 2, config.key_heads, 20, config.head_width
    )  # what is not filled does not matter
    for row, count in enumerate(counts):
        cache[row, ..., :count, :] = columns[row, ..., :count, :]
    for place in range(4):
        start = counts + place
        step = tokens[torch.arange(3), start][:, None]
        logits, columns = served(step, torch.ones(3, dtype=torch.long), start, cache)
        assert torch.allclose(logits, expected[torch.arange(3), start], atol=1e-4)
        cache[torch.arange(3), ..., start, :] = columns[..., 0, :]


@torch.no_grad()
def test_replies_are_the_same_alone_and_in_company():
    model = language()
    asked = [
        Asked(Message("text_to_motion", [[1, 2, 3]], length=6), 5),
        Asked(Message("motion_to_text", condition=[[[7, 8, 9]]]), 6),
        Asked(Message("prediction", condition=[[[1]], [[2]]]), 7, agents=2),
    ]
    together = replies(model, asked, Sampling(1.0, 50, 0.9, 1.2), most=8)
    assert [replies(model, [one], Sampling(1.0, 50, 0.9, 1.2), most=8)[0] for one in asked] == together
    assert len(together[0]) == 6 and together[2].count(AGENT_SEP) == 1
    greedy = replies(model, asked[:1], Sampling(0.0))[0]
    prompt = asked[0].message.prompt(VOCABULARY)
    mask = Rules("text_to_motion", 2, 8, 128, length=6).allowed(VOCABULARY, len(prompt), [])
    assert greedy[0] == int(model(torch.tensor([prompt]))[0, -1].masked_fill(~mask, -1e9).argmax())


@torch.no_grad()
def test_guidance_adds_what_the_content_and_the_style_change():
    model = language(4)
    styled, plain = (Message("text_to_motion", [pieces], length=6) for pieces in ([1, 2, 3], [1, 3]))
    nothing = Message("unconditional", length=6)
    guides = Sampling(content_guidance=2.0, style_guidance=3.5).guides(styled, [1, 3])
    assert [(guide.message, guide.weight) for guide in guides] == [(plain, -1.5), (nothing, -1.0)]
    assert Sampling().guides(styled, [1, 3]) == []
    alone = Asked(Message("text_to_motion", [[4]], length=5), 8)
    together = replies(model, [Asked(styled, 5, guides=guides), alone, Asked(styled, 6)], Sampling(0.0), most=8)
    expected: list[int] = []
    first, end = VOCABULARY.span("motion")
    for _ in range(6):
        both, content, none = (
            model(torch.tensor([m.prompt(VOCABULARY) + expected]))[0, -1] for m in (styled, plain, nothing)
        )
        mixed = none + 2.0 * (content - none) + 3.5 * (both - content)
        expected.append(first + int(mixed[first:end].argmax()))
    assert together[0] == expected
    unguided = replies(model, [alone, Asked(styled, 6)], Sampling(0.0), most=8)
    assert together[1:] == unguided and together[0] != unguided[1]


def test_drawing_follows_top_k_top_p_and_repetition():
    logits = torch.tensor([2.0, 1.9, 0.0, -1.0])
    drawn = {Sampling(1.0, 2).draw(logits, [], seed, 0) for seed in range(60)}
    assert drawn == {0, 1}
    assert {Sampling(1.0, 0, 0.4).draw(logits, [], seed, 0) for seed in range(60)} == {0}
    assert Sampling(0.0, repetition=1.3).draw(logits, [0], 1, 0) == 1


def test_flow_from_noise_has_the_shape_of_the_draft():
    torch.manual_seed(4)
    tokenizer = Tokenizer(TINY.tokenizer, SKELETON).eval()
    flow = FlowDecoder(TINY.flow, 5, tokenizer.body.state_width).eval()
    tokens = torch.randint(4375, (2, 3))
    with torch.no_grad():
        state = flow_sample(flow, tokenizer, tokens, torch.randn(2, 12, 22), 4)
    assert state.shape == (2, 12, 22) and torch.isfinite(state).all()


def test_flow_makes_what_the_draft_leaves():
    torch.manual_seed(4)
    tokenizer = Tokenizer(TINY.tokenizer, SKELETON).eval()
    flow = FlowDecoder(TINY.flow, 5, tokenizer.body.state_width).eval()
    tokens = torch.randint(4375, (2, 3))
    draft = tokenizer.state(tokenizer.embed(tokens))
    flow.spread.fill_(0.25)
    noise = torch.randn(2, 12, 22)
    with torch.no_grad():
        untrained = flow_sample(flow, tokenizer, tokens, noise, 4)  # its velocity is zero
    expected = draft + 0.25 * noise * tokenizer.state_scale.std
    torch.testing.assert_close(untrained, expected, atol=1e-5, rtol=1e-5)
