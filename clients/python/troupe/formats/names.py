"""Joints' names as programs write them: namespaces, sides, and words. The reader of the server takes names apart alike."""

from __future__ import annotations

from typing import NamedTuple

_SIDES = {"left": "left", "l": "left", "lft": "left", "right": "right", "r": "right", "rgt": "right"}
_LEG = ["foot", "toe", "toes", "toebase", "ankle", "leg", "upleg", "thigh", "femur", "shin", "tibia", "calf"]
_PARTS = frozenset([*_LEG, "hand", "wrist", "arm", "humerus", "radius"])
"""Parts of a body that may follow a side without a gap: `lfemur`."""
STEERING = frozenset({"ik", "target", "pole", "ctrl", "control"})
"""Words of joints that steer a rig and are not of the body."""
HELPERS = STEERING | {"fk", "helper", "twist", "roll"}
"""Words of joints that steer or help a limb, and are no joint of it."""


class Name(NamedTuple):
    """A name taken apart."""

    side: str
    """`left`, `right`, or nothing."""
    words: tuple[str, ...]
    """In small letters, without the side and numbers."""

    def has(self, words: frozenset[str]) -> bool:
        """Whether it has one of these words."""
        return not words.isdisjoint(self.words)


def parse(name: str) -> Name:
    """Takes a name apart: `mixamorig:LeftUpLeg` is left, and has the words up and leg."""
    side, rest = "", []
    for word in _words(_without_namespace(name)):
        if word in _SIDES:
            side = side or _SIDES[word]
        elif word[0] in "lr" and word[1:] in _PARTS:
            side = side or _SIDES[word[0]]
            rest.append(word[1:])
        else:
            rest.append(word)
    return Name(side, tuple(rest))


def mirrored(name: str) -> str | None:
    """The name of the right-hand counterpart of a left-hand joint: `LeftUpLeg`, `left_hip`, `UpperLeg_L`, `thigh.l`."""
    for left, right in (("Left", "Right"), ("left", "right"), ("LEFT", "RIGHT")):
        if left in name:
            return name.replace(left, right, 1)
    for left, right in ("LR", "lr"):
        for mark in "_.- ":
            if name.endswith(mark + left):
                return name[:-1] + right
            if name.startswith(left + mark):
                return right + name[1:]
    return None


def _without_namespace(name: str) -> str:
    """What stands after the last `:` or `|`, if anything does."""
    return name.replace("|", ":").rsplit(":", 1)[-1] or name


def _words(name: str) -> list[str]:
    words, word = [], ""
    for before, letter, after in zip(" " + name, name, name[1:] + " ", strict=False):
        # The last capital of several begins the next word: LHip.
        begins = letter.isupper() and (before.islower() or (before.isupper() and after.islower()))
        if word and (begins or not letter.isalpha()):
            words.append(word)
            word = ""
        if letter.isalpha():
            word += letter.lower()
    return [*words, word] if word else words
