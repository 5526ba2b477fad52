"""Captions: what is measured, how it is said, and that a seed says the same again."""

import numpy as np
import pytest

from troupe_training.data.captions import (
    CONTENTS,
    STYLES,
    caption,
    gerund,
    plain_captions,
    style_phrases,
    third,
    unstyled,
)
from troupe_training.data.facts import Facts, measured, named

WALK = Facts("walk", "angry", 3.0, 1.2, 0.0)


@pytest.mark.parametrize(
    ("phrase", "thirds", "gerunds"),
    [
        ("walk and turn left", "walks and turns left", "walking and turning left"),
        ("wave both hands", "waves both hands", "waving both hands"),
        ("dash", "dashes", "dashing"),
        ("run forward", "runs forward", "running forward"),
        ("punch", "punches", "punching"),
        ("put the left hand up", "puts the left hand up", "putting the left hand up"),
    ],
)
def test_verbs_are_bent(phrase: str, thirds: str, gerunds: str):
    assert third(phrase) == thirds
    assert gerund(phrase) == gerunds


def test_a_seed_says_the_same_and_others_say_more():
    said = [caption(WALK, seed) for seed in range(200)]
    assert said == [caption(WALK, seed) for seed in range(200)]
    assert len(set(said)) > 80
    assert all(text == text.lower() and "  " not in text and text.strip() == text for text in said)


def test_every_caption_names_the_content_and_the_style():
    styles = {word for words in (*STYLES["angry"].adverbs, *STYLES["angry"].adjectives) for word in words.split()}
    for seed in range(100):
        words = set(caption(WALK, seed).split())
        assert words & {"walk", "walks", "walking", "stroll", "strolls", "strolling"}
        assert words & styles


@pytest.mark.parametrize("content", CONTENTS)
def test_a_caption_without_its_style_is_one_that_names_none(content: str):
    phrases = style_phrases()
    words = {
        word for said in (CONTENTS[content].verbs, CONTENTS[content].nouns) for text in said for word in text.split()
    }
    assert not words & {phrase for phrase in phrases if " " not in phrase}
    for style in STYLES:
        for seed in range(4):
            left = unstyled(caption(Facts(content, style, 3.0, 1.2, 0.0), seed), phrases)
            assert left is not None and unstyled(left, phrases) is None
            assert not any(f" {phrase} " in f" {left} " for phrase in phrases)


def test_a_style_is_taken_out_of_a_sentence():
    phrases = style_phrases()
    assert unstyled("an angry person walks", phrases) == "a person walks"
    assert (
        unstyled("a person waves like an elderly person for two seconds", phrases) == "a person waves for two seconds"
    )
    assert unstyled("worn out", phrases) == ""
    assert unstyled("a person walks", phrases) is None


def test_what_was_measured_is_said_and_nothing_else():
    slow, fast = Facts("walk", None, 5.0, 0.3, 0.0), Facts("walk", None, 5.0, 2.0, 2.0)
    texts = [{caption(facts, seed) for seed in range(300)} for facts in (slow, fast)]
    assert any("slow pace" in text for text in texts[0]) and not any("fast pace" in text for text in texts[0])
    assert any("fast pace" in text for text in texts[1]) and any("turning left" in text for text in texts[1])
    assert not any("turning" in text for text in texts[0])
    assert any("five seconds" in text for text in texts[0])


def test_names_that_no_table_has_are_said_as_they_are():
    assert plain_captions("moon-walk", "cheeky") == [
        "a person moon walks in a cheeky way".replace("moon walks", "moons walk")
    ]
    assert len({text for content in CONTENTS for text in plain_captions(content, "sad")}) > 2 * len(CONTENTS)


def test_names_of_clips_are_read():
    assert named("dataset-2_wave-left-hand_normal_012.bvh") == ("wave-left-hand", "normal")
    assert named("dataset-2_wave-left-hand_normal_012_M.bvh", mirrored=True) == ("wave-right-hand", "normal")
    assert named("dataset-1_walk_masculinity_001.bvh") == ("walk", "masculine")
    assert named("walk_07.bvh") == ("walk", None)


def test_speed_turn_and_hand_are_measured():
    frames = 61
    time = np.arange(frames) / 30
    positions = np.zeros((frames, 3, 3))
    positions[:, :, 2] = time[:, None] * 1.5
    positions[:, 2, 1] = np.sin(9 * time)  # the right hand waves
    facts = measured("bye", None, positions, np.unwrap(time * 2.0), (1, 2))
    assert facts.speed_mps == pytest.approx(1.5, rel=0.03)
    assert facts.turn_rad == pytest.approx(4.0, rel=0.02)
    assert facts.hand == "right"
