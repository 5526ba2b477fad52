"""A small robot, written as a URDF, and walks of it as CSV: root x y z qx qy qz qw, then ten angles, Z up."""

import math
import random
from pathlib import Path

HIP_M, THIGH_M, SHIN_M, SOLE_M = 0.1, 0.4, 0.4, 0.05
COLUMNS = [
    *[f"{side}_{name}" for side in ("left", "right") for name in ("hip", "knee", "ankle")],
    "waist",
    *[f"{side}_{name}" for side in ("left", "right") for name in ("shoulder",)],
]


def joint(name: str, parent: str, child: str, xyz: str, axis: str, **more: str) -> str:
    """One revolute joint."""
    limits = f'<limit lower="{more.get("lower", "-2")}" upper="{more.get("upper", "2")}" effort="9" velocity="20"/>'
    return (
        f'<joint name="{name}_joint" type="{more.get("kind", "revolute")}"><origin xyz="{xyz}" '
        f'rpy="{more.get("rpy", "0 0 0")}"/><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
        f"{limits}{more.get('inside', '')}</joint>"
    )


def link(name: str, inside: str = "") -> str:
    """One link."""
    return f'<link name="{name}">{inside}</link>'


def coupled(multiplier: str = "-0.5") -> str:
    """The robot of `biped` whose ankles follow the knees, which leaves seven hinges."""
    text = biped()
    for side in ("left", "right"):
        ankle = text.index(f'<joint name="{side}_ankle_joint"')
        end = text.index("</joint>", ankle)
        mimic = f'<mimic joint="{side}_knee_joint" multiplier="{multiplier}" offset="0.1"/>'
        text = text[:end] + mimic + text[end:]
    return text


def coupled_rows(rows: list[list[float]]) -> list[list[float]]:
    """Rows of `biped` without the angles of its ankles."""
    return [[*row[:9], *row[10:12], *row[13:]] for row in rows]


def ball(xyz: str, radius: float = 0.01) -> str:
    """A collision sphere."""
    return f'<collision><origin xyz="{xyz}"/><geometry><sphere radius="{radius}"/></geometry></collision>'


def biped(sole: str | None = None) -> str:
    """The URDF: legs of hip, knee and ankle pitch, a waist, shoulders that roll, hands fixed to the arms.

    The knees are mounted turned about their axis by 0.2 and the shins turned back, as on real robots.
    """
    if sole is None:
        sole = "".join(ball(f"{x} {y} -0.04") for x in (-0.05, 0.15) for y in (0.03, -0.03))
    parts = [link("pelvis"), link("torso")]
    for side, sign in (("left", 1), ("right", -1)):
        hip, knee, ankle, arm = (f"{side}_{name}_link" for name in ("hip", "knee", "ankle", "arm"))
        parts += [link(hip), link(knee), link(ankle, sole), link(arm), link(f"{side}_palm")]
        parts += [
            joint(f"{side}_hip", "pelvis", hip, f"0 {sign * HIP_M} 0", "0 1 0", rpy="0 -0.2 0"),
            joint(f"{side}_knee", hip, knee, _tilted(THIGH_M), "0 1 0", rpy="0 0.2 0", lower="-0.2", upper="2.5"),
            joint(f"{side}_ankle", knee, ankle, f"0 0 {-SHIN_M}", "0 1 0"),
        ]
    parts.append(joint("waist", "pelvis", "torso", "0 0 0.1", "0 0 1"))
    for side, sign in (("left", 1), ("right", -1)):
        lower, upper = ("-0.3", "2.5") if sign > 0 else ("-2.5", "0.3")
        arm = f"{side}_arm_link"
        parts.append(joint(f"{side}_shoulder", "torso", arm, f"0 {sign * 0.2} 0.3", "1 0 0", lower=lower, upper=upper))
        parts.append(
            f'<joint name="{side}_palm_joint" type="fixed"><origin xyz="0 {sign * 0.01} -0.5"/>'
            f'<parent link="{arm}"/><child link="{side}_palm"/></joint>'
        )
    return f'<robot name="toy">{"".join(parts)}</robot>'


def _tilted(length: float) -> str:
    """The way down a thigh that is vertical while its hip's frame is pitched by -0.2."""
    return f"{-length * math.sin(0.2)} 0 {-length * math.cos(0.2)}"


def walk_rows(frames: int, speed: float, heading: float, cadence: float) -> list[list[float]]:
    """A straight walk with bent knees; the feet stay about on the ground."""
    rows = []
    for frame in range(frames):
        seconds, turn = frame / 30, math.radians(heading)
        swing = 0.3 * math.sin(2 * math.pi * cadence * seconds)
        legs = []
        for side in (1, -1):
            knee = 0.3 - 0.2 * side * math.cos(2 * math.pi * cadence * seconds)
            hip = -side * swing - knee / 2
            legs += [hip, knee, -hip - knee]
        root = [speed * seconds * math.cos(turn), speed * seconds * math.sin(turn), 0.82]
        quaternion = [0.0, 0.0, math.sin(turn / 2), math.cos(turn / 2)]
        rows.append([*root, *quaternion, *legs, 0.3 * swing, 0.2 + 0.2 * swing, -0.4 + 0.3 * swing])
    return rows


def write_rows(path: Path, rows: list[list[float]]) -> Path:
    """One CSV file."""
    path.write_text("".join(",".join(f"{v:.6f}" for v in row) + "\n" for row in rows))
    return path


def write_robot(folder: Path, clips: int = 16) -> Path:
    """The URDF at ``folder/toy.urdf`` and walks in ``folder/csv``; every fourth is by ``subject5``."""
    (folder / "csv").mkdir(parents=True)
    (folder / "toy.urdf").write_text(biped())
    rng = random.Random(3)
    for i in range(clips):
        rows = walk_rows(rng.randint(70, 100), rng.uniform(0.3, 1.0), rng.uniform(-180, 180), rng.uniform(0.7, 1.2))
        write_rows(folder / "csv" / f"walk{i:02}_subject{5 if i % 4 == 0 else 1}.csv", rows)
    return folder
