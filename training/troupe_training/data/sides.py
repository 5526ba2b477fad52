"""Left and right by name: which joint is whose mirror image."""

import re

SIDES = (
    (re.compile("Left"), "Right"),
    (re.compile("left"), "right"),
    (re.compile("LEFT"), "RIGHT"),
    (re.compile(r"([ _.:-])L$"), r"\1R"),
    (re.compile(r"([ _.:-])l$"), r"\1r"),
    (re.compile(r"(^|[ _.:-])L(?=[ A-Z_.:-])"), r"\1R"),
    (re.compile(r"(^|[ _.:-])l(?=[ A-Z_.:-])"), r"\1r"),
    # Robots' limbs with numbers (leg_l6), and legs of quadrupeds (FL_calf, RL_calf).
    (re.compile(r"([ _.:-])L(?=\d+([ _.:-]|$))"), r"\1R"),
    (re.compile(r"([ _.:-])l(?=\d+([ _.:-]|$))"), r"\1r"),
    (re.compile(r"(^|[ _.:-])([FRH])L(?=[ _.:-]|$)"), r"\1\2R"),
    (re.compile(r"(^|[ _.:-])([frh])l(?=[ _.:-]|$)"), r"\1\2r"),
)


def right_of(name: str, names: list[str]) -> str | None:
    """The name among ``names`` that differs from the left joint ``name`` in the side alone."""
    mirrored = {pattern.sub(other, name, count=1) for pattern, other in SIDES if pattern.search(name)}
    return next((other for other in names if other != name and other in mirrored), None)


def side_pairs(names: list[str]) -> list[tuple[int, int]]:
    """Index pairs (left, right) of the names that differ in the side alone."""
    pairs = []
    for left, name in enumerate(names):
        other = right_of(name, names)
        if other is not None:
            pairs.append((left, names.index(other)))
    return pairs
