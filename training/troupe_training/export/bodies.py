"""``bodies/NAME.toml``: a body in a pack's folder."""

import json
from pathlib import Path

import torch

from troupe_training.data.bodies import Body
from troupe_training.data.rotations import matrix_to_quat
from troupe_training.export.manifest import skeleton_lines


def write_body(pack: Path, body: Body, words: list[str], command: str) -> None:
    """Writes a body's file: skeleton and robot as a manifest has them, its neutral pose and what it was seen to do."""
    quats = matrix_to_quat(torch.tensor(body.rotations))
    lines = [
        f"# Written by `{command}`.",
        f"name = {json.dumps(body.name)}",
        f"words = {json.dumps(words)}",
        f"height_m = {body.height_m}",
        f"size_m = {body.size_m}",
        "",
        "# World rotations (w, x, y, z) of the neutral pose, and 1 left, -1 right, 0 middle: in the order of the joints.",
        "[neutral]",
        f"sides = {json.dumps(body.sides)}",
        "rotations = [",
        *(f"  {json.dumps([round(float(v), 9) for v in quat])}," for quat in quats),
        "]",
    ]
    folder = pack / "bodies"
    folder.mkdir(exist_ok=True)
    (folder / f"{body.name}.toml").write_text("\n".join(lines + skeleton_lines(body.skeleton)) + "\n")
