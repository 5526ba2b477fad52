"""Words to motion and back, against a real server whose pack has random weights."""

import asyncio
import itertools
import math

import numpy as np
import pytest

import troupe
import troupe.aio
from troupe.v1 import motion_pb2


def still(words: troupe.Client, frames: int, x: float = 0.0, z: float = 0.0) -> troupe.Clip:
    """A body that stands still while it slides along +Z."""
    pack = words.pack()
    root = np.zeros((frames, 3), np.float32)
    root[:, 0], root[:, 1], root[:, 2] = x, 0.9, z + 0.03 * np.arange(frames)
    rotations = np.zeros((frames, pack.skeleton.joint_count, 4), np.float32)
    rotations[..., 0] = 1.0
    return troupe.Clip(pack.skeleton, pack.fps, root, rotations)


def same(first: troupe.Clip, second: troupe.Clip) -> bool:
    return np.array_equal(first.root, second.root) and np.array_equal(first.rotations, second.rotations)


def test_the_pack_says_what_it_takes(words: troupe.Client) -> None:
    pack = words.pack()
    assert {"text", "describe", "agents"} <= pack.capabilities
    assert pack.message.language.audio_codes == 64
    assert "music_to_dance" in pack.message.language.tasks


def test_words_become_motion_in_parts(words: troupe.Client) -> None:
    prompt = troupe.Prompt("an old robot walks", seconds=2.0)
    made = words.generate(prompt=prompt, seed=3)
    assert len(made.clip) == 60 and not made.others
    assert made.notes == ("captions of the pack's training have not used: robot",)
    parts = list(words.generate_parts(prompt=prompt, seed=3))
    assert len(parts) > 1 and {part.character for part in parts} == {0}
    assert same(troupe.join_clips([part.clip for part in parts]), made.clip)
    assert not same(words.generate(prompt=prompt, seed=4).clip, made.clip)
    # The model decides on the length of words alone.
    assert len(words.generate(prompt="someone waves").clip) >= 8


def test_sampling_is_the_packs_or_the_callers(words: troupe.Client) -> None:
    prompt = troupe.Prompt("someone walks", frames=40)
    likeliest = troupe.Sampling(temperature=0.0)
    first, second = (words.generate(prompt=prompt, seed=seed, sampling=likeliest).clip for seed in (1, 2))
    assert same(first, second)
    usual = words.generate(prompt=prompt, seed=1)
    own = words.pack().message.language.sampling
    said = troupe.Sampling(own.temperature, own.top_k, own.top_p, own.repetition)
    assert same(words.generate(prompt=prompt, seed=1, sampling=said).clip, usual.clip)
    with pytest.raises(troupe.InvalidArgumentError, match="more than 0, and at most 1") as caught:
        words.generate(prompt=prompt, sampling=troupe.Sampling(top_p=1.5))
    assert caught.value.field == "sampling.top_p"


def test_motion_goes_on_from_a_past_and_leads_to_targets(words: troupe.Client) -> None:
    past, targets = still(words, 40), still(words, 16, z=2.2)
    on = words.generate(prompt="a person walks", past=past[-16:]).clip
    assert np.linalg.norm(on.root[0] - past.root[-1]) < 0.3
    between = words.generate(prompt=troupe.Prompt(frames=32, targets=targets), past=past).clip
    assert len(between) == 32
    assert np.linalg.norm(between.root[-1] - targets.root[0]) < 0.3
    with pytest.raises(troupe.InvalidArgumentError, match="is missing") as caught:
        words.generate(prompt=troupe.Prompt(targets=targets), past=past)
    assert caught.value.field == "prompt.frame_count"


def test_motion_ends_at_a_place(words: troupe.Client) -> None:
    made = words.generate(prompt=troupe.Prompt("someone walks", seconds=3.0, to=(0.6, 1.0, math.pi / 2)), seed=3)
    assert len(made.clip) == 90
    assert np.linalg.norm(made.clip.root[-1, [0, 2]] - (0.6, 1.0)) < 0.05
    past = still(words, 16)
    on = words.generate(prompt=troupe.Prompt("someone walks", seconds=3.0, to=(-0.5, 1.2, 0.0)), past=past).clip
    assert np.linalg.norm(on.root[-1, [0, 2]] - (-0.5, 1.2)) < 0.05
    assert np.linalg.norm(on.root[0] - past.root[-1]) < 0.3
    with pytest.raises(troupe.InvalidArgumentError, match=r"frame_count \d+ or more") as caught:
        words.generate(prompt=troupe.Prompt("someone walks", seconds=1.0, to=(0.0, 40.0, 0.0)))
    assert caught.value.field == "prompt.targets[0].root.position"


def test_a_place_on_the_wire_is_a_root_alone() -> None:
    prompt = troupe.Prompt("someone walks", to=(0.5, -2.0, 1.5)).to_message()
    (target,) = prompt.targets
    assert not target.HasField("pose") and not prompt.HasField("frame_count")
    assert (target.root.position.x, target.root.position.z, target.root.heading) == (0.5, -2.0, 1.5)
    for wrong in ((1.0, 2.0), (1.0, math.nan, 0.0)):
        with pytest.raises(troupe.InvalidArgumentError) as caught:
            troupe.Prompt("someone walks", to=wrong).to_message()
        assert caught.value.field == "to"
    key = troupe.Keyframe(root=(0.0, 0.9, 1.0), heading=0.0)
    with pytest.raises(troupe.InvalidArgumentError, match="one of the two"):
        troupe.Prompt("someone walks", targets=[key], to=(0.0, 1.0, 0.0)).to_message()


def test_two_characters_move_together(words: troupe.Client) -> None:
    other = troupe.Agent("someone waves", still(words, 16, x=1.0))
    prompt = troupe.Prompt("someone walks", seconds=2.0, others=[other])
    made = words.generate(prompt=prompt, past=still(words, 16), seed=1)
    assert [len(clip) for clip in (made.clip, *made.others)] == [60, 60]
    assert abs(made.others[0].root[0, 0] - 1.0) < 0.3 and abs(made.clip.root[0, 0]) < 0.3
    description = words.describe(made.clip, others=made.others, seed=2)
    assert description and description == words.describe(made.clip, others=made.others, seed=2)
    assert description != words.describe(made.clip, seed=2)


def test_audio_goes_both_ways(words: troupe.Client) -> None:
    walk = still(words, 40)
    dances = []
    for sound in troupe.Sound:
        audio = words.audio_of(walk, sound, seed=5)
        assert audio.sound is sound and len(audio.codes) > 0 and max(audio.codes) < 64
        prompt = troupe.Prompt(frames=40, audio=troupe.Audio(sound, audio.codes[:40]))
        dances.append(words.generate(prompt=prompt).clip)
        assert len(dances[-1]) == 40
    assert not same(*dances)
    with pytest.raises(troupe.InvalidArgumentError, match="codes below 64") as caught:
        words.generate(prompt=troupe.Prompt(audio=troupe.Audio(troupe.Sound.MUSIC, [64])))
    assert caught.value.field == "prompt.audio.codes"


def test_motion_becomes_words_in_parts(words: troupe.Client) -> None:
    walk = still(words, 40)
    description = words.describe(walk, seed=5)
    assert description and "".join(words.describe_parts(walk, seed=5)) == description
    with pytest.raises(troupe.InvalidArgumentError, match="4 to 259") as caught:
        words.describe(still(words, 300))
    assert caught.value.field == "frames"
    with pytest.raises(troupe.InvalidArgumentError, match="resample it first"):
        words.describe(troupe.Clip(walk.skeleton, 60.0, walk.root, walk.rotations))


def test_what_is_wrong_with_words_is_said(words: troupe.Client) -> None:
    for text, said in (
        ("  ", "is empty"),
        ("zz " * 60, "180 pieces long"),
        ("\u8d70", "letters that the pack can read"),
    ):
        with pytest.raises(troupe.InvalidArgumentError, match=said) as caught:
            words.generate(prompt=text)
        assert caught.value.field == "prompt.text"


def test_a_stream_may_be_left(words: troupe.Client) -> None:
    prompt = troupe.Prompt("someone walks", frames=1024)
    for _ in range(40):
        assert len(list(itertools.islice(words.generate_parts(prompt=prompt), 1))) == 1
    assert len(words.generate(prompt=troupe.Prompt("someone waves", frames=20)).clip) == 20


def test_the_same_awaits(words: troupe.Client, words_address: str) -> None:
    prompt = troupe.Prompt("someone walks", seconds=2.0, others=[troupe.Agent("someone waves")])
    walk = still(words, 40)

    async def main() -> None:
        async with troupe.aio.Client(words_address) as client:
            made, description = await asyncio.gather(
                client.generate(prompt=prompt, seed=1), client.describe(walk, seed=1)
            )
            blocking = words.generate(prompt=prompt, seed=1)
            assert same(made.clip, blocking.clip) and same(made.others[0], blocking.others[0])
            assert description == words.describe(walk, seed=1)
            assert "".join([part async for part in client.describe_parts(walk, seed=1)]) == description
            parts = [part async for part in client.generate_parts(prompt=prompt, seed=1)]
            assert {part.character for part in parts} == {0, 1}
            audio = await client.audio_of(walk, troupe.Sound.SPEECH)
            assert list(audio.codes) == list(words.audio_of(walk, troupe.Sound.SPEECH).codes)

    asyncio.run(main())


def test_messages_hold_what_was_said() -> None:
    sampling = troupe.Sampling(temperature=0.5, top_k=7)
    assert sampling.to_message() == motion_pb2.Sampling(temperature=0.5, top_k=7)
    message = troupe.Prompt("walk", flow_steps=4, audio=troupe.Audio(troupe.Sound.SPEECH, [1, 2])).to_message()
    assert (message.text, message.flow_steps, message.audio.sound) == ("walk", 4, motion_pb2.SOUND_SPEECH)
    assert not message.HasField("seconds") and not message.HasField("frame_count")
