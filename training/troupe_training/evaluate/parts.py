"""The windows of a report apart: by data set, content, style, or held-out cell of their clips."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from troupe_training.data.cells import CLIP_NAME, cell_of, read_cells
from troupe_training.data.store import PIECES, ClipEntry
from troupe_training.evaluate.tables import MEASURES, Figure, Measure

OTHER = "other clips"
HELD_OUT = "held-out cells"
# Measures that a part's table has; the JSON has all.
SHOWN = ("l2p_m", "nearer_than_pack", "npss", "foot_skate_m_per_frame", "fid")
# With fewer windows FID and MMD show the number of windows, not the motion.
FEWEST_FOR_DISTANCES = 64
# Clips of LaFAN1, whole or parts: what they show, the take's number, who shows it.
LAFAN1_NAME = re.compile(r"(?P<content>[A-Za-z]+)\d+_subject\d+(_part\d+)?(_M)?(\.\w+)?$")
PartOf = Callable[[ClipEntry], str]


def part_of(by: str, cells: Path | None) -> PartOf:
    """Names the part of a clip: its data set, content or style, or whether it is of a held-out cell.

    Cells are those of the list ``cells``, or those that the cache was prepared without.
    """
    listed = None if cells is None else read_cells(cells)

    def held_out(clip: ClipEntry) -> bool:
        return clip.get("held_out", False) if listed is None else cell_of(clip["name"]) in listed

    def of_name(clip: ClipEntry) -> str:
        found = CLIP_NAME.match(clip["name"]) or (LAFAN1_NAME.match(clip["name"]) if by == "content" else None)
        if found is None:
            return OTHER
        return f"dataset-{found['set']}" if by == "dataset" else found[by]

    return (lambda clip: HELD_OUT if held_out(clip) else OTHER) if by == "cell" else of_name


def masks(parts: PartOf, clips: list[ClipEntry], pieces: np.ndarray) -> dict[str, np.ndarray]:
    """Which windows ``[W]`` belong to each part, in the order of the parts' names; ``pieces`` are those of the windows."""
    names = np.array([parts(clips[int(piece) // PIECES]) for piece in pieces])
    return {str(name): names == name for name in np.unique(names)}


def _rows(parts: list[dict[str, Any]], measure: Measure, methods: list[str]) -> list[str]:
    rows = []
    for part in parts:
        for block in part["gaps"]:
            figures: list[Figure | None] = [block["methods"].get(m, {}).get(measure.name) for m in methods]
            if any(figures):
                cells = [measure.cell(figure) for figure in figures]
                frames = block["gap_frames"]
                gap = "all" if frames is None else str(frames)
                rows.append("| " + " | ".join([part["name"], gap, str(block["windows"]), *cells]) + " |")
    return rows


def parts_markdown(report: dict[str, Any]) -> list[str]:
    """A heading for each grouping of ``report["parts"]``, and a table for each measure of `SHOWN`."""
    texts = []
    for by, parts in report.get("parts", {}).items():
        texts.append(f"### By {by}")
        methods = list(parts[0]["gaps"][0]["methods"])
        for measure in (m for name in SHOWN for m in MEASURES if m.name == name):
            if rows := _rows(parts, measure, methods):
                head = "| " + " | ".join([by, "gap", "windows", *methods]) + " |"
                texts.append(
                    "\n".join([f"{measure.heading}:", "", head, "|---" + "|---:" * (len(methods) + 2) + "|", *rows])
                )
    return texts
