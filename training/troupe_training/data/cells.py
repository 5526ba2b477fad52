"""Cells of content × style that no model is trained on: the combination is new to it, content and style are not.

The list is ``splits/bandai-namco-cells.txt``: one ``CONTENT_STYLE`` a line, as in the names of the clips
(``dataset-2_CONTENT_STYLE_ID.bvh``). A clip of either data set that shows a held-out content in a held-out style is left out.
"""

import hashlib
import re
from collections.abc import Iterable
from pathlib import Path

CLIP_NAME = re.compile(r"dataset-(?P<set>\d+)_(?P<content>[^_]+)_(?P<style>[^_.]+)(_\d+)?(_M)?(\.bvh)?$")
# The two data sets name one style by two words.
SAME_STYLE = {"masculinity": "masculine"}
# Other names of a content: a mirrored clip of the first shows the second.
MIRRORED = (("left", "right"), ("right", "left"))


def cell_of(clip: str) -> str | None:
    """``CONTENT_STYLE`` of a clip's name; None for names of another form."""
    found = CLIP_NAME.match(clip)
    if found is None:
        return None
    style = found["style"]
    return f"{found['content']}_{SAME_STYLE.get(style, style)}"


def mirrored_cell(cell: str) -> str:
    """The cell that the mirror image of a clip shows."""
    for side, other in MIRRORED:
        if side in re.split("[-_]", cell):
            return re.sub(rf"(?<![a-z]){side}(?![a-z])", other, cell)
    return cell


def read_cells(path: Path) -> frozenset[str]:
    """The cells of a list, one a line; lines that begin with # say what it is."""
    lines = (line.strip() for line in path.read_text(encoding="utf-8").splitlines())
    return frozenset(line for line in lines if line and not line.startswith("#"))


def choose_cells(clips: Iterable[str], data_set: str = "2") -> list[str]:
    """One cell for each style of a data set, every content at most once.

    Styles take turns in alphabetical order. Each takes the content, not yet taken, whose SHA-256 of ``CONTENT_STYLE`` is
    smallest. With more contents than styles each content stays in training in all styles but one.
    """
    by_style: dict[str, set[str]] = {}
    for clip in clips:
        found = CLIP_NAME.match(clip)
        if found is not None and found["set"] == data_set:
            by_style.setdefault(found["style"], set()).add(found["content"])
    taken: set[str] = set()
    cells = []
    for style in sorted(by_style):
        free = {f"{content}_{style}": content for content in by_style[style] - taken}
        cell = min(free, key=lambda name: hashlib.sha256(name.encode()).hexdigest())
        taken.add(free[cell])
        cells.append(cell)
    return cells
