"""Skeletons of characters that no model has, with the joints that stand for a model's."""

from dataclasses import dataclass

import numpy as np

Row = tuple[str, str | None, tuple[float, float, float]]


@dataclass
class Rig:
    """A skeleton of the protocol, and what is known of it."""

    skeleton: dict
    # The rig's joints for those of the model.
    joints: dict[str, str]


def times(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The product of two quaternions x, y, z, w."""
    vector = a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])
    return np.append(vector, a[3] * b[3] - a[:3] @ b[:3])


def inverse(q: np.ndarray) -> np.ndarray:
    return q * [-1, -1, -1, 1]


def rotated(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return times(times(q, np.append(v, 0.0)), inverse(q))[:3]


def turn(axis, angle: float) -> np.ndarray:
    unit = np.asarray(axis, float) / np.linalg.norm(axis)
    return np.append(unit * np.sin(angle / 2), np.cos(angle / 2))


def along(bone: np.ndarray, roll: float) -> np.ndarray:
    """A rotation whose Y axis lies along a bone, as Blender's and Mixamo's joints have it, rolled about it."""
    direction = bone / np.linalg.norm(bone)
    axis = np.cross([0, 1, 0], direction)
    angle = np.arctan2(np.linalg.norm(axis), direction[1])
    if np.linalg.norm(axis) < 1e-6:
        axis = np.array([1.0, 0.0, 0.0])
    return times(turn(axis, angle), turn([0, 1, 0], roll))


def skeleton(rows: list[Row], size: float, is_twisted: bool) -> dict:
    """The skeleton of joints at places in the world. Its rest rotations lie along the bones with a roll of their own,
    or, as Blender's add-on sends them, have the world's axes."""
    places = {name: size * np.array(place) for name, _, place in rows}
    world: dict[str | None, np.ndarray] = {None: np.array([0.0, 0.0, 0.0, 1.0])}
    joints = []
    for nth, (name, parent, _) in enumerate(rows):
        below = [places[child] for child, above, _ in rows if above == name]
        bone = np.mean(below, axis=0) - places[name] if below else np.array([0.0, 1.0, 0.0])
        own = along(bone, 0.7 * nth) if is_twisted else world[None]
        offset = places[name] - (places[parent] if parent else 0)
        joints.append(
            {
                "name": name,
                "parent": parent,
                "rest_translation": [float(v) for v in rotated(inverse(world[parent]), offset)],
                "rest_rotation": [float(v) for v in times(inverse(world[parent]), own)],
            }
        )
        world[name] = own
    return {"joints": joints, "coordinate_system": "right_handed_y_up", "units": "meters"}


def both(rows: list[Row], sides=("L", "R")) -> list[Row]:
    """The rows, with those of the left side, in whose names `{}` stands for it, on both sides."""
    made = []
    for name, parent, (x, y, z) in rows:
        for side, across in zip(sides, (x, -x), strict=True) if "{" in name else [("", x)]:
            made.append((name.format(side), parent and parent.format(side), (across, y, z)))
    return made


def mixamo(size=1.12, is_twisted=True) -> Rig:
    """A rig as Mixamo makes them: in a T pose, with fingers."""
    rows: list[Row] = [
        ("Hips", None, (0, 0.98, 0)),
        ("Spine", "Hips", (0, 1.08, 0)),
        ("Spine1", "Spine", (0, 1.19, -0.01)),
        ("Spine2", "Spine1", (0, 1.31, -0.01)),
        ("Neck", "Spine2", (0, 1.48, -0.02)),
        ("Head", "Neck", (0, 1.57, 0.01)),
        ("HeadTop_End", "Head", (0, 1.76, 0.02)),
        ("{}Shoulder", "Spine2", (0.06, 1.43, -0.02)),
        ("{}Arm", "{}Shoulder", (0.18, 1.42, -0.02)),
        ("{}ForeArm", "{}Arm", (0.46, 1.42, -0.02)),
        ("{}Hand", "{}ForeArm", (0.72, 1.42, -0.01)),
        ("{}HandThumb1", "{}Hand", (0.75, 1.4, 0.03)),
        ("{}HandThumb2", "{}HandThumb1", (0.78, 1.39, 0.06)),
        ("{}HandIndex1", "{}Hand", (0.82, 1.42, 0.02)),
        ("{}HandIndex2", "{}HandIndex1", (0.86, 1.42, 0.02)),
        ("{}UpLeg", "Hips", (0.09, 0.92, 0)),
        ("{}Leg", "{}UpLeg", (0.09, 0.5, 0.01)),
        ("{}Foot", "{}Leg", (0.09, 0.09, -0.03)),
        ("{}ToeBase", "{}Foot", (0.09, 0.02, 0.1)),
        ("{}Toe_End", "{}ToeBase", (0.09, 0.01, 0.18)),
    ]
    prefix = "mixamorig:"
    rows = [(prefix + name, parent and prefix + parent, place) for name, parent, place in both(rows, ("Left", "Right"))]
    parts = {"Arm": "UpperArm", "ForeArm": "LowerArm", "Hand": "Hand", "UpLeg": "UpperLeg", "Leg": "LowerLeg"}
    parts |= {"Foot": "Foot", "ToeBase": "Toes"}
    joints = {
        f"{model}_{side[0]}": f"{prefix}{side}{part}" for part, model in parts.items() for side in ("Left", "Right")
    }
    joints |= {"Hips": f"{prefix}Hips", "Head": f"{prefix}Head"}
    return Rig(skeleton(rows, size, is_twisted), joints)


def rigify(size=0.7, is_twisted=True) -> Rig:
    """The deform bones of a rig as Blender's Rigify makes them: in a T pose, with two bones along each limb."""
    rows = both(
        [
            ("DEF-spine", None, (0, 0.98, 0.02)),
            ("DEF-spine.001", "DEF-spine", (0, 1.1, 0)),
            ("DEF-spine.002", "DEF-spine.001", (0, 1.23, 0)),
            ("DEF-spine.003", "DEF-spine.002", (0, 1.36, -0.01)),
            ("DEF-spine.004", "DEF-spine.003", (0, 1.52, -0.02)),
            ("DEF-spine.005", "DEF-spine.004", (0, 1.57, 0)),
            ("DEF-spine.006", "DEF-spine.005", (0, 1.62, 0)),
            ("DEF-shoulder.{}", "DEF-spine.003", (0.02, 1.47, 0.03)),
            ("DEF-upper_arm.{}", "DEF-shoulder.{}", (0.18, 1.46, -0.03)),
            ("DEF-upper_arm.{}.001", "DEF-upper_arm.{}", (0.31, 1.46, -0.03)),
            ("DEF-forearm.{}", "DEF-upper_arm.{}.001", (0.44, 1.46, -0.03)),
            ("DEF-forearm.{}.001", "DEF-forearm.{}", (0.56, 1.46, -0.02)),
            ("DEF-hand.{}", "DEF-forearm.{}.001", (0.68, 1.46, -0.01)),
            ("DEF-f_index.01.{}", "DEF-hand.{}", (0.77, 1.46, 0.02)),
            ("DEF-thigh.{}", "DEF-spine", (0.1, 0.95, 0.02)),
            ("DEF-thigh.{}.001", "DEF-thigh.{}", (0.1, 0.73, 0.02)),
            ("DEF-shin.{}", "DEF-thigh.{}.001", (0.1, 0.51, 0.03)),
            ("DEF-shin.{}.001", "DEF-shin.{}", (0.1, 0.3, 0)),
            ("DEF-foot.{}", "DEF-shin.{}.001", (0.1, 0.09, -0.02)),
            ("DEF-toe.{}", "DEF-foot.{}", (0.1, 0.02, 0.11)),
        ]
    )
    parts = {"upper_arm": "UpperArm", "forearm": "LowerArm", "hand": "Hand", "thigh": "UpperLeg", "shin": "LowerLeg"}
    parts |= {"foot": "Foot", "toe": "Toes"}
    joints = {f"{model}_{side}": f"DEF-{part}.{side}" for part, model in parts.items() for side in "LR"}
    joints |= {"Hips": "DEF-spine", "Head": "DEF-spine.006"}
    return Rig(skeleton(rows, size, is_twisted), joints)


def other_animal(model: dict, size=0.6, legs=1.0) -> Rig:
    """An animal with a model's joints under names that say nothing, in another size, perhaps with longer legs."""
    joints = model["canonical_skeleton"]["joints"]
    name = {joint["name"]: f"bone_{nth:03}" for nth, joint in enumerate(joints)}
    places: dict[str, np.ndarray] = {}
    rows: list[Row] = []
    for joint in joints:
        offset = np.array(joint["rest_translation"])
        if "_leg_" in joint["name"] and "pelvis" not in joint["name"]:
            offset = legs * offset
        above = places[joint["parent"]] if joint["parent"] else np.zeros(3)
        places[joint["name"]] = above + offset
    lowest = min(place[1] for place in places.values())
    for joint in joints:
        x, y, z = places[joint["name"]] - [0, lowest, 0]
        parent = name[joint["parent"]] if joint["parent"] else None
        rows.append((name[joint["name"]], parent, (x, y, z)))
    return Rig(skeleton(rows, size, True), name)


def octopus() -> dict:
    """A head on eight arms, which stands on nothing."""
    rows: list[Row] = [("mantle", None, (0, 0.5, 0))]
    for arm in range(8):
        x, z = np.cos(arm * np.pi / 4), np.sin(arm * np.pi / 4)
        above: str = "mantle"
        for nth in range(1, 5):
            name = f"arm_{arm}_{nth}"
            rows.append((name, above, (0.2 * nth * x, 0.5 - 0.1 * nth, 0.2 * nth * z)))
            above = name
    return skeleton(rows, 1.0, True)
