"""``pack.toml``: written here, read here."""

import json
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from troupe_training.data.conventions import FPS
from troupe_training.data.limits import Limits
from troupe_training.data.skeleton import RobotTable, Skeleton

LIMITS_COMMENT = "# Written by `troupe-train limits`: what the training data does at most."
FORMAT = 2  # of the manifest; servers read 1 as well, which names no family


@dataclass(frozen=True)
class Family:
    """The family that runs a pack, and its capabilities by the server's names (`Capability`)."""

    name: str
    capabilities: tuple[str, ...]


@dataclass
class About:
    """A manifest's facts of a pack besides its networks and skeleton."""

    name: str
    version: str
    licence: str = "unknown"  # of the weights
    credits: list[str] = field(default_factory=list)
    training: dict[str, Any] = field(default_factory=dict)


def read_manifest(pack: Path) -> dict[str, Any]:
    """The manifest of a pack folder."""
    return tomllib.loads((pack / "pack.toml").read_text())


def write_manifest(
    pack: Path,
    family: Family,
    about: About,
    networks: dict[str, int],
    digest: str,
    skeleton: Skeleton,
    checks: dict[str, float],
) -> None:
    """Writes the manifest.

    ``networks`` are the sizes that the server goes by, ``digest`` is the SHA-256 of the ONNX files, ``checks`` are their
    largest differences to PyTorch, empty for files that do not come from it.
    """
    compared = [
        *("", "# Largest difference between ONNX Runtime and PyTorch.", "[training.onnx_check]"),
        *(f"{stage} = {difference:.2e}" for stage, difference in checks.items()),
    ]
    lines = [
        "# Written by `troupe-train export`. The server refuses the pack if the hash does not fit the ONNX files.",
        f"format = {FORMAT}",
        f"family = {json.dumps(family.name)}",
        f"name = {json.dumps(about.name, ensure_ascii=False)}",
        f"version = {json.dumps(about.version)}",
        f"licence = {json.dumps(about.licence, ensure_ascii=False)}",
        f"credits = {json.dumps(about.credits, ensure_ascii=False)}",
        f"fps = {FPS}",
        *(f"{key} = {value}" for key, value in networks.items()),
        f'content_hash = "sha256:{digest}"',
        *("", "[capabilities]"),
        *(f"{name} = true" for name in family.capabilities),
        *skeleton_lines(skeleton),
        *("", "[training]"),
        *(f"{key} = {json.dumps(value)}" for key, value in about.training.items()),
        *(compared if checks else []),
    ]
    (pack / "pack.toml").write_text("\n".join(lines) + "\n")


def set_values(lines: list[str], table: str, values: dict[str, Any]) -> None:
    """Sets values of one table in the lines of a manifest; of the table "", those before the first table.

    A key that is missing comes after the table's others, a table that is missing at the end.
    """
    header = f"[{table}]"
    if table and header not in lines:
        lines += ["", header]
    first = lines.index(header) + 1 if table else 0
    for key, value in values.items():
        end = next((i for i in range(first, len(lines)) if lines[i].startswith("[")), len(lines))
        own = [i for i in range(first, end) if " = " in lines[i] and not lines[i].startswith("#")]
        here = next((i for i in own if lines[i].startswith(f"{key} = ")), None)
        line = f"{key} = {json.dumps(value, ensure_ascii=False)}"
        if here is None:
            lines.insert(own[-1] + 1 if own else first, line)
        else:
            lines[here] = line


def set_version(pack: Path, version: str | None) -> None:
    """Sets a pack's version, if one is given."""
    if version:
        path = pack / "pack.toml"
        lines = path.read_text(encoding="utf-8").splitlines()
        set_values(lines, "", {"version": version})
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_limits(manifest: Path, limits: Limits) -> None:
    """Puts the table ``[limits]`` into a manifest, or into the file of a body, in the place of one that is there.

    All other lines stay as they are, the hash of the networks among them. Raises `ValueError` if the joints are others.
    """
    text = manifest.read_text(encoding="utf-8")
    joints = [joint["name"] for joint in tomllib.loads(text)["skeleton"]["joints"]]
    measured = [bend.joint for bend in limits.bends]
    if measured != joints[1:]:
        raise ValueError(f"the skeleton of {manifest} is not that of the cache")
    kept = lines_without(text, "limits", LIMITS_COMMENT)
    before = next((i for i, line in enumerate(kept) if line == "[training]"), len(kept))
    table = [LIMITS_COMMENT, *limits.lines(), ""]
    lines = [*_stripped(kept[:before]), "", *table, *kept[before:]]
    manifest.write_text("\n".join(_stripped(lines)) + "\n", encoding="utf-8")


def lines_without(text: str, table: str, comment: str) -> list[str]:
    """The lines of a manifest, or of a body's file, without one of its tables and the comment above it.

    A table ends at the next one, or at the comment above that.
    """
    kept, inside = [], False
    for line in text.splitlines():
        if line.startswith(("[", "#")):
            inside = line.startswith("[") and line.strip("[]").split(".")[0] == table
        if not inside and line != comment:
            kept.append(line)
    return _stripped(kept)


def _stripped(lines: list[str]) -> list[str]:
    """Without empty lines at the end."""
    while lines and not lines[-1]:
        lines = lines[:-1]
    return lines


def skeleton_lines(skeleton: Skeleton) -> list[str]:
    """A skeleton's tables, and those of its robot."""
    lines = [
        "",
        "[skeleton]",
        f"left_axis = {json.dumps(skeleton.left_axis)}",
        "ground_y_m = 0.0",
        "",
        "[skeleton.contacts]",
        f"joints = {json.dumps([skeleton.names[j] for j in skeleton.contact_joints])}",
        f"max_height_m = {json.dumps(skeleton.contact_max_height_m)}",
        f"max_speed_mps = {skeleton.contact_max_speed_mps}",
        f"clearance_m = {json.dumps(skeleton.contact_clearance_m)}",
    ]
    for joint, parent, offset in zip(skeleton.names, skeleton.parents, skeleton.offsets, strict=True):
        lines += [
            "",
            "[[skeleton.joints]]",
            f"name = {json.dumps(joint)}",
            f"parent = {json.dumps(skeleton.names[parent] if parent >= 0 else '')}",
            f"offset_m = {json.dumps(offset)}",
        ]
    return lines + _robot_lines(skeleton.robot)


def _robot_lines(robot: RobotTable | None) -> list[str]:
    """Hinges in the order of the motion files' columns, and what follows them; nothing for characters."""
    if robot is None:
        return []
    lines = ["", "[robot]", f"name = {json.dumps(robot['name'])}"]
    for hinge in robot["hinges"]:
        lines += ["", "[[robot.hinges]]"] + [f"{key} = {json.dumps(value)}" for key, value in hinge.items()]
    for mimic in robot.get("mimics", []):
        lines += ["", "[[robot.mimics]]"] + [f"{key} = {json.dumps(value)}" for key, value in mimic.items()]
    return lines
