"""Files of motion through `troupe_reader`, which reads them for every program of Troupe."""

from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np

from troupe_reader import Clip
from troupe_training.data.clips import FileMotion
from troupe_training.data.conventions import FPS
from troupe_training.data.neutral import quaternion_matrix

# Findings of a report, and what each is called in a table.
FINDINGS = {
    "format": "format",
    "producer": "producer",
    "skeleton": "skeleton",
    "up": "up axis",
    "unit_m": "metres a unit",
    "fps": "rate, Hz",
    "rest_pose": "rest pose",
}
NOTES = {"repairs": "repaired", "oddities": "odd"}
# Oddities that `cut` finds by itself, and acts on.
CUT = ("speed", "ground")


def file_motion(clip: Clip) -> FileMotion:
    """A clip of a file at 30 fps, in world terms."""
    report = clip.report
    if clip.fps != FPS:
        clip = clip.resample(FPS)
    positions, quaternions = clip.world()
    skeleton = clip.skeleton
    notes = [note["text"] for note in report["oddities"] if note["topic"] not in CUT] if report else []
    return FileMotion(
        skeleton.names,
        skeleton.parents,
        skeleton.offsets.astype(np.float64),
        positions.astype(np.float64),
        quaternion_matrix(quaternions.astype(np.float64)),
        notes,
        report,
    )


def understood(reports: Iterable[dict[str, Any]]) -> list[list[str]]:
    """A table of what was understood of files: what, its values with the number of files, and one line of evidence."""
    reports = list(reports)
    rows = []
    for key, what in FINDINGS.items():
        found = [report[key] for report in reports if report[key] is not None]
        counts = Counter(str(one["value"]) for one in found)
        if counts:
            values = ", ".join(f"{value} ({count})" for value, count in counts.most_common())
            rows.append([what, values, found[0]["evidence"]])
    for key, what in NOTES.items():
        first: dict[str, str] = {}
        topics: Counter[str] = Counter()
        for report in reports:
            topics.update({note["topic"] for note in report[key]})
            for note in report[key]:
                first.setdefault(note["topic"], f"{report['file']}: {note['text']}")
        rows += [[what, f"{topic} ({count})", first[topic]] for topic, count in topics.most_common()]
    return rows


def printed(table: Iterable[list[str]]) -> list[str]:
    """Lines of such a table for people."""
    return [f"{what}: {values}; {evidence}" for what, values, evidence in table]
