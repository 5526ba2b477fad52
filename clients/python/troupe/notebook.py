"""Motion as a page that plays without a network: for notebooks, and to be saved as a file."""

from __future__ import annotations

import base64
import html
import json
from functools import cache
from importlib.resources import files

import numpy as np

from troupe.arrays import F32

MAX_BYTES = 12 << 20
"""Positions of a page take at most this; of longer motion every second frame is shown, or every third, and so on."""
HEIGHT_PX = 420
_PLACE = '"motion goes here"'


@cache
def _template() -> str:
    return files("troupe").joinpath("player.html").read_text(encoding="utf-8")


def page(positions: F32, parents: tuple[int, ...], fps: float, characters: int, title: str = "") -> str:
    """A page that plays native world positions (frames, characters, joints, 3)."""
    stride = 1 + positions.size * 4 // MAX_BYTES
    shown = np.ascontiguousarray(positions[::stride], "<f4")
    motion = {
        "title": title,
        "fps": fps / stride,
        "frames": len(shown),
        "characters": characters,
        "parents": parents,
        "positions": base64.b64encode(shown.tobytes()).decode(),
    }
    # `<` could end the script that holds the text.
    text = json.dumps(motion).replace("<", "\\u003c")
    before, after = _template().split(_PLACE)
    return before + text + after


def frame(document: str) -> str:
    """A page inside of another, such as a notebook, apart from its styles and scripts."""
    style = f"width:100%;max-width:900px;height:{HEIGHT_PX}px;border:0;border-radius:8px"
    return f'<iframe sandbox="allow-scripts" style="{style}" srcdoc="{html.escape(document)}"></iframe>'
