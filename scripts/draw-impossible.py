"""Draws three targets that cannot be met: what comes without `strict`, and the nearest that `strict` accepts.

draw-impossible.py OUT.png, with the server that TROUPE_SERVER names and its default pack. Context and target are those of
examples/request.json. `make film-impossible` does it with a server of its own.
"""

import copy
import json
import math
import os
import sys
import textwrap
import urllib.error
import urllib.request
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl

mpl.use("agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib import font_manager
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
# Units of the figures of a verdict, by the end of their names.
UNITS = {"speed": " m/s", "acceleration": " m/s$^2$", "root_reach": " m", "pose_reach": " m", "ground": " m"}
DARK, MUTED, RULE = "#1f2933", "#7b8794", "#d5dbe2"
CONTEXT, TARGET, REFUSED, ACCEPTED = "#6b7580", "#f08c00", "#c92a2a", "#2b8a3e"
RAMP = mpl.colors.LinearSegmentedColormap.from_list("ramp", ["#1b6fd8", "#7a4dd8", "#d8438c"])
PIXELS_PER_METRE = 96.0
WIDTH, BLOCK, TOP = 1600, 368, 96
# Where the two strips of a block begin.
ASKED_X, POSSIBLE_X = 40.0, 1190.0


def ask(character: dict, path: str = "/v1/inbetween") -> dict:
    """The answer for one character, or the error."""
    url = os.environ.get("TROUPE_SERVER", "http://127.0.0.1:8080") + path
    body = json.dumps({"characters": [character]}).encode()
    request = urllib.request.Request(url, body, {"content-type": "application/json"})
    try:
        with urllib.request.urlopen(request) as response:
            return json.load(response)["characters"][0]
    except urllib.error.HTTPError as error:
        return json.load(error)


@dataclass
class Case:
    """A kind of target, of which more or less can be asked for."""

    title: str
    # The character of a request that asks for so much.
    request: Callable[[float], dict]
    asked: float
    # What the most that is accepted is called.
    possible: str
    # Generated poses of the two strips.
    poses: tuple[int, int]
    # Distance between poses in metres; none to draw them at their own places.
    spread: tuple[float | None, float | None]

    def most(self) -> float:
        """The most that a strict request gets, by bisection."""
        low, high = 0.0, self.asked
        for _ in range(12):
            middle = (low + high) / 2
            refused = "error" in ask({**self.request(middle), "strict": True})
            low, high = (low, middle) if refused else (middle, high)
        return low


def cases(example: dict) -> list[Case]:
    """What is asked for."""
    places = [np.array([key["root"]["position"][axis] for axis in "xyz"]) for key in example["context"]]
    went = (places[-1] - places[0]) * (1, 0, 1)
    ahead = went / np.linalg.norm(went)

    def character(frames: int, targets: list[dict]) -> dict:
        return {**example, "targets": targets, "frame_count": frames, "return_positions": True}

    def at(key: dict, place: np.ndarray) -> dict:
        key = copy.deepcopy(key)
        key["root"]["position"] = dict(zip("xyz", (float(value) for value in place), strict=True))
        return key

    target = example["targets"][0]
    height = target["root"]["position"]["y"]

    def far(metres: float) -> dict:
        return character(34, [at(target, places[-1] * (1, 0, 1) + ahead * metres + (0, height, 0))])

    def lying(degrees: float) -> dict:
        # Tipped over backwards about where it stands, by the axis that points to the left. Lying,
        # the hips are 12 cm up.
        angle = math.radians(degrees)
        up = (height * math.cos(angle) + 0.12 * math.sin(angle)) * np.array([0, 1, 0])
        key = at(target, places[-1] * (1, 0, 1) + ahead * (1.7 - height * math.sin(angle)) + up)
        half = -angle / 2
        turn = (math.cos(half), *(math.sin(half) * np.array([ahead[2], 0.0, -ahead[0]])))
        key["pose"]["rotations"][:4] = times(turn, key["pose"]["rotations"][:4])
        # A heading of its own would be of the pose that stands.
        key["root"].pop("heading", None)
        return character(48, [key])

    def apart(metres: float) -> dict:
        first = places[-1] * (1, 0, 1) + ahead * 1.1 + (0, height, 0)
        return character(35, [at(target, first), at(target, first + ahead * metres)])

    return [
        Case("10 m ahead in 30 frames", far, 10.0, "at most {:.2f} m in 30 frames", (8, 2), (None, None)),
        Case("On the back in 44 frames", lying, 90.0, "a lean back of at most {:.0f}°", (6, 1), (1.15, 1.05)),
        Case(
            "Two targets 1 m apart, in consecutive frames",
            apart,
            1.0,
            "at most {:.2f} m from one to the next",
            (3, 2),
            (None, None),
        ),
    ]


def times(a: tuple, b: list) -> list[float]:
    """The product of two quaternions, w first."""
    (aw, *av), (bw, *bv) = a, b
    av, bv = np.array(av), np.array(bv)
    return [float(aw * bw - av @ bv), *(float(value) for value in aw * bv + bw * av + np.cross(av, bv))]


class Figures:
    """Draws poses as stick figures, seen from the right-hand side of the way, a little from above."""

    def __init__(self, axes: plt.Axes, joints: list[dict], heading: float, small: font_manager.FontProperties) -> None:
        self.small = small
        self.axes, self.parents = axes, [joint["parent"] for joint in joints]
        self.head = next(nth for nth, joint in enumerate(joints) if joint["name"] == "Head")
        turn, pitch = 0.3, 0.14
        ahead = np.array([math.sin(heading), 0, math.cos(heading)])
        side = np.cross(ahead, [0, 1, 0])
        self.right = math.cos(turn) * ahead - math.sin(turn) * side
        near = np.cross(self.right, [0, 1, 0])
        self.up = math.cos(pitch) * np.array([0, 1, 0]) - math.sin(pitch) * near

    def across(self, place: np.ndarray) -> float:
        """How far to the right a place is, metres."""
        return float(place @ self.right)

    def draw(self, places: np.ndarray, x: float, ground: float, ink: tuple | str) -> None:
        """A pose whose places are relative to what comes to stand at `x`."""
        flat = np.stack([x + places @ self.right * PIXELS_PER_METRE, ground - places @ self.up * PIXELS_PER_METRE], 1)
        bones = [(parent, joint) for joint, parent in enumerate(self.parents) if parent >= 0]
        for width, colour in ((9.5, "white"), (6.5, ink)):
            for bone in bones:
                self.axes.plot(*flat[list(bone)].T, color=colour, lw=width * 0.72, solid_capstyle="round", zorder=3)
        neck = flat[self.parents[self.head]]
        along = (flat[self.head] - neck) / max(float(np.linalg.norm(flat[self.head] - neck)), 1e-6)
        head = flat[self.head] + along * 0.06 * PIXELS_PER_METRE
        self.axes.add_patch(plt.Circle(tuple(head), 0.105 * PIXELS_PER_METRE, fc=ink, ec="white", lw=1, zorder=4))


def strip(figures: Figures, answer: dict, case: Case, which: int, x: float, ground: float) -> None:
    """The poses of an answer at even steps of time, context first and targets last."""
    frames = answer["frames"]
    count = frames["frame_count"]
    places = np.array(frames["positions"]).reshape(count, -1, 3)
    targets = len(case.request(0)["targets"])
    inner = [
        3 + round((count - targets - 3) * nth / (case.poses[which] + 1)) for nth in range(1, case.poses[which] + 1)
    ]
    shown = [3, *inner, *range(count - targets, count)]
    spread, origin = case.spread[which], places[3, 0] * (1, 0, 1)
    end = x
    for slot, frame in enumerate(shown):
        ink = (
            CONTEXT if frame < 4 else TARGET if frame >= count - targets else RAMP((frame - 4) / (count - targets - 5))
        )
        own = places[frame, 0] * (1, 0, 1)
        at = spread * slot if spread else figures.across(own - origin)
        place = x + 46 + at * PIXELS_PER_METRE
        figures.draw(places[frame] - own, place, ground, ink)
        # Labels that would cover one another are left out.
        if slot == 0 or place > end:
            figures.axes.text(
                place, ground + 34, str(frame - 3), color=ink, ha="center", va="baseline", fontproperties=figures.small
            )
            end = place + 24


def draw(out: Path) -> None:
    """Asks and draws."""
    url = os.environ.get("TROUPE_SERVER", "http://127.0.0.1:8080")
    with urllib.request.urlopen(url + "/v1/packs") as response:
        pack = next(pack for pack in json.load(response)["packs"] if pack.get("is_default"))
    example = json.loads((ROOT / "examples/request.json").read_text())["characters"][0]
    fonts = [ROOT / f"cli/assets/Inter-{weight}-subset.ttf" for weight in ("Regular", "SemiBold")]
    all_cases = cases(example)
    height = TOP + BLOCK * len(all_cases)
    figure = plt.figure(figsize=(WIDTH / 100, height / 100), dpi=100)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, WIDTH), ylim=(height, 0))
    axes.axis("off")
    first, last = (example["context"][nth]["root"]["position"] for nth in (0, -1))
    heading = math.atan2(last["x"] - first["x"], last["z"] - first["z"])
    small = font_manager.FontProperties(fname=fonts[0], size=10.5)
    figures = Figures(axes, pack["joints"], heading, small)

    def text(x: float, y: float, words: str, colour: str = MUTED, size: float = 11.5, bold: bool = False) -> None:
        font = font_manager.FontProperties(fname=fonts[bold], size=size)
        axes.text(x, y, words, color=colour, fontproperties=font, va="baseline")

    text(40, 46, "Three targets that cannot be met", DARK, 20, bold=True)
    text(40, 72, "Below each pose: frames after the last context frame")
    for x, colour, name in (
        (1160, CONTEXT, "last context frame"),
        (1340, "#7a4dd8", "generated"),
        (1455, TARGET, "target"),
    ):
        axes.add_patch(plt.Circle((x, 41), 6, color=colour))
        text(x + 14, 46, name, DARK)
    for nth, case in enumerate(all_cases):
        top = TOP + BLOCK * nth
        ground = top + 246
        axes.plot([40, WIDTH - 40], [top, top], color=RULE, lw=1)
        text(40, top + 32, f"{nth + 1}  {case.title}", DARK, 14.5, bold=True)
        asked = ask(case.request(case.asked))
        refusal = ask({**case.request(case.asked), "strict": True})["error"]
        most = case.most()
        found = asked["feasibility"]
        worst = found[found["worst"]]
        unit = next((unit for end, unit in UNITS.items() if found["worst"].endswith(end)), " rad")
        excess = f"{found['worst']} is {worst['value']:.3g}{unit}, {found['ratio']:.1f} times its limit"
        text(40, top + 58, f"Without strict this comes, and the answer says that it is not feasible: {excess}")
        text(POSSIBLE_X, top + 58, "is the most that strict accepts")
        text(POSSIBLE_X, top + 32, case.possible.format(most), ACCEPTED, 14.5, bold=True)
        for x, end in ((ASKED_X, POSSIBLE_X - 40), (POSSIBLE_X, WIDTH - 40)):
            axes.plot([x, end], [ground, ground], color=RULE, lw=1, zorder=1)
        strip(figures, asked, case, 0, ASKED_X, ground)
        strip(figures, ask(case.request(most)), case, 1, POSSIBLE_X, ground)
        lines = textwrap.wrap(f"{refusal['message']}", 150)
        text(40, ground + 64, "Strict refuses it:", REFUSED, 11.5, bold=True)
        for row, line in enumerate(lines):
            text(190, ground + 64 + 22 * row, line, DARK)
        print(f"{case.title}: {refusal['message']}\n  accepted: {case.possible.format(most)}")
    figure.savefig(out)
    # A palette makes a third of the file.
    Image.open(out).convert("RGB").quantize(128, dither=Image.Dither.NONE).save(out, optimize=True)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: draw-impossible.py OUT.png")
    draw(Path(sys.argv[1]))
