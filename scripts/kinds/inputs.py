"""One input of each kind that used to go wrong, with the motion that it holds."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

import formats
from motion import Array, Motion, about, matrix, multiply, read_walk
from robots import Joint, Robot, go2, humanoid, kuavo

ROOT = Path(__file__).resolve().parents[2]
SMPL = (
    "pelvis left_hip<pelvis right_hip<pelvis spine1<pelvis left_knee<left_hip right_knee<right_hip spine2<spine1 "
    "left_ankle<left_knee right_ankle<right_knee spine3<spine2 left_foot<left_ankle right_foot<right_ankle neck<spine3 "
    "left_collar<spine3 right_collar<spine3 head<neck left_shoulder<left_collar right_shoulder<right_collar "
    "left_elbow<left_shoulder right_elbow<right_shoulder left_wrist<left_elbow right_wrist<right_elbow"
)
G1 = (
    "pelvis left_hip_pitch<pelvis left_hip_roll<left_hip_pitch left_hip_yaw<left_hip_roll left_knee<left_hip_yaw "
    "left_ankle_pitch<left_knee left_ankle_roll<left_ankle_pitch left_toe_base<left_ankle_roll right_hip_pitch<pelvis "
    "right_hip_roll<right_hip_pitch right_hip_yaw<right_hip_roll right_knee<right_hip_yaw right_ankle_pitch<right_knee "
    "right_ankle_roll<right_ankle_pitch right_toe_base<right_ankle_roll waist_yaw<pelvis waist_roll<waist_yaw "
    "waist_pitch<waist_roll left_shoulder_pitch<waist_pitch left_shoulder_roll<left_shoulder_pitch "
    "left_shoulder_yaw<left_shoulder_roll left_elbow<left_shoulder_yaw left_wrist_roll<left_elbow "
    "left_wrist_pitch<left_wrist_roll left_wrist_yaw<left_wrist_pitch left_hand_roll<left_wrist_yaw "
    "right_shoulder_pitch<waist_pitch right_shoulder_roll<right_shoulder_pitch right_shoulder_yaw<right_shoulder_roll "
    "right_elbow<right_shoulder_yaw right_wrist_roll<right_elbow right_wrist_pitch<right_wrist_roll "
    "right_wrist_yaw<right_wrist_pitch right_hand_roll<right_wrist_yaw"
)
SOMA = (
    "Hips Spine1<Hips Spine2<Spine1 Chest<Spine2 Neck1<Chest Neck2<Neck1 Head<Neck2 Jaw<Head LeftEye<Head RightEye<Head "
    "LeftShoulder<Chest LeftArm<LeftShoulder LeftForeArm<LeftArm LeftHand<LeftForeArm LeftHandThumbEnd<LeftHand "
    "LeftHandMiddleEnd<LeftHand RightShoulder<Chest RightArm<RightShoulder RightForeArm<RightArm RightHand<RightForeArm "
    "RightHandThumbEnd<RightHand RightHandMiddleEnd<RightHand LeftLeg<Hips LeftShin<LeftLeg LeftFoot<LeftShin "
    "LeftToeBase<LeftFoot RightLeg<Hips RightShin<RightLeg RightFoot<RightShin RightToeBase<RightFoot"
)


@dataclass
class Kind:
    """An input, what is right for it, and what happened before."""

    group: str  # row of the table
    name: str
    file: str
    data: bytes
    truth: Motion
    before: str
    options: dict[str, Any] = field(default_factory=dict)  # that the error or the note names
    robot: Robot | None = None
    legs: list[str] = field(default_factory=list)  # with the options
    onto: Motion | None = None  # a pack's skeleton to read onto, on the fronts that can
    rig: Motion | None = None  # the viewer's skeleton, if it is not the truth's
    options_onto: dict[str, Any] = field(default_factory=dict)  # the viewer's, which reads onto a skeleton, if others
    refusal: str | None = None  # what a right refusal says
    beside: dict[str, bytes] = field(default_factory=dict)
    mirror: bool = False
    open_order: bool = False  # the quaternion's order shows in nothing, and the usual one is noted
    open_rate: bool = False  # the file says no rate, and 30 Hz is assumed and noted


WALK = read_walk((ROOT / "examples" / "walk.bvh").read_text())
TEXT = formats.bvh(WALK)


def turned(axis: tuple[float, float, float], angle: float, motion: Motion) -> Motion:
    """The world, turned."""
    turn = about(axis, angle)
    roots = np.stack([matrix(turn) @ root for root in motion.roots])
    turns = motion.turns.copy()
    turns[:, 0] = multiply(np.broadcast_to(turn, turns[:, 0].shape), turns[:, 0])
    return replace(motion, roots=roots, turns=turns)


def person() -> Motion:
    """A person with a T-pose at rest, who walks with arms that hang."""
    tree = (
        "Hips Spine<Hips Head<Spine "
        "LeftUpLeg<Hips LeftLeg<LeftUpLeg LeftFoot<LeftLeg LeftToeBase<LeftFoot "
        "RightUpLeg<Hips RightLeg<RightUpLeg RightFoot<RightLeg RightToeBase<RightFoot "
        "LeftArm<Spine LeftForeArm<LeftArm LeftHand<LeftForeArm RightArm<Spine RightForeArm<RightArm RightHand<RightForeArm"
    )
    leg: list[tuple[float, float, float]] = [(0, -0.42, 0), (0, -0.4, 0), (0, -0.06, 0.13)]
    arm = [(0.28, 0, 0), (0.25, 0, 0)]
    offsets: list[tuple[float, float, float]] = [(0, 0, 0), (0, 0.47, 0), (0, 0.2, 0)]
    for side in (1, -1):
        offsets += [(0.09 * side, -0.05, 0), *leg]
    for side in (1, -1):
        offsets += [(0.17 * side, -0.05, 0)] + [(x * side, y, z) for x, y, z in arm]
    names, parents = tree_of(tree)
    t = np.arange(90) / 30
    turns = np.zeros((90, len(names), 4))
    turns[..., 0] = 1
    for word, sign in (("Left", 1), ("Right", -1)):
        swing = sign * 0.4 * np.sin(6 * t)
        turns[:, names.index(f"{word}UpLeg")] = about((1, 0, 0), swing)
        turns[:, names.index(f"{word}Leg")] = about((1, 0, 0), 0.3 + 0.2 * np.sin(6 * t + sign))
        hang = np.broadcast_to(about((0, 0, 1), -1.3 * sign), (90, 4))
        turns[:, names.index(f"{word}Arm")] = multiply(about((1, 0, 0), -swing), hang)
    turns[:, 0] = about((0, 1, 0), 0.3 * t)
    roots = np.stack([0.3 * t * t, np.full(90, 0.93), 1.2 * t], -1)
    return Motion(names, parents, np.array(offsets, np.float64), 30.0, roots, turns)


def tree_of(text: str) -> tuple[list[str], list[int]]:
    """Names and parents of `name<parent` words."""
    words = [word.partition("<") for word in text.split()]
    names = [word[0] for word in words]
    return names, [names.index(word[2]) if word[2] else -1 for word in words]


def swinging(tree: str, fps: float, offset: Callable[[int], Array], frames: int = 60, by_rad: float = 0.3) -> Motion:
    """All joints of a tree swing; the root walks ahead, upright."""
    names, parents = tree_of(tree)
    t = np.arange(frames) / fps
    turns = np.stack(
        [about(np.array([0.6, 0.64, 0.48]), by_rad * np.sin(4 * t + nth)) for nth in range(len(names))], axis=1
    )
    turns[:, 0] = about((0, 1, 0), 0.4 * t)
    roots = np.stack([0.2 * t, 0.95 + 0.02 * np.sin(6 * t), 1.1 * t], -1)
    offsets = np.stack([offset(nth) for nth in range(len(names))])
    return Motion(names, parents, offsets, fps, roots, turns)


def kinds() -> Iterator[Kind]:
    """All inputs."""
    yield from bones()
    yield from axes_and_rates()
    yield from gltf()
    yield from robots()
    yield from texts()
    yield from archives()


def bones() -> Iterator[Kind]:
    """Rest poses and bones."""
    generator = np.random.default_rng(5)
    axes = generator.normal(size=(len(WALK.names), 4))
    axes[0] = (1, 0, 0, 0)
    other = WALK.on_other_axes(axes / np.linalg.norm(axes, axis=-1, keepdims=True))
    before = "nonsense: bones 64° off on average"
    yield Kind(
        "other rest pose",
        "on its own skeleton",
        "other_bones.bvh",
        formats.bvh(other).encode(),
        WALK,
        before,
        rig=other,
    )
    yield Kind(
        "other rest pose", "onto a pack's, `--other-bones`", "other_bones.bvh", formats.bvh(other).encode(),
        WALK, before, {"other_bones": True}, onto=WALK, refusal="points .*° away|bones differ|--other-bones plays",
    )  # fmt: skip
    before = "person of 0.25 m, headings NaN"
    offsets = WALK.offsets.copy()
    offsets[[WALK.names.index(f"UpperLeg_{side}") for side in "LR"]] = 0
    flat = replace(WALK, offsets=offsets)
    yield Kind("hips without length", "", "zero_hips.bvh", formats.bvh(flat).encode(), flat, before)
    before = "arms 90 to 115° off, feet 0.8 m in the air"
    yield Kind("T-posed skeleton of one's own", "", "t_pose.bvh", formats.bvh(person()).encode(), person(), before)


def axes_and_rates() -> Iterator[Kind]:
    """Rates, axes and units of BVH."""
    for fps in (24, 25, 50, 100):
        clip = WALK.at(fps)
        before = "dropped, or bones up to 13.6 mm short"
        yield Kind("rate", f"{fps} fps", f"rate{fps}.bvh", formats.bvh(clip).encode(), clip, before)
    lying = turned((1, 0, 0), np.pi / 2, WALK)
    before = "people who lie, 0.18 m high"
    yield Kind("Z up", "", "z_up.bvh", formats.bvh(lying).encode(), WALK, before)
    yield Kind("inches", "", "inches.bvh", formats.bvh(WALK, 0.0254).encode(), WALK, before)


def gltf() -> Iterator[Kind]:
    """Binary glTF of rigs."""
    group, before = "loose rigs", "exit 0 with 11 of 67 joints"
    mean_held, rig = slide(0.002)
    yield Kind(group, "spine slides 2 mm", "spine.glb", rig.glb(), mean_held, before)
    mean_held, rig = slide(0.002, scale=0.01)
    yield Kind(group, "the same, Armature of 1:100", "armature.glb", rig.glb(), mean_held, before)
    mean_held, rig = slide(0.6, "UpperArm_L")
    yield Kind(
        group, "arm leaves by 0.6 m", "arm.glb", rig.glb(), mean_held, before, {"max_slide": 1.0},
        options_onto={"other_bones": True, "max_slide": 1.0},
    )  # fmt: skip
    group, before = "glTF", "refused"
    rig = formats.Gltf(WALK)
    rig.move(None, "translation", WALK.roots)
    yield Kind(group, "channel without `node`", "no_node.glb", rig.glb(), WALK, before)
    rig = formats.Gltf(WALK)
    target = rig.move(None, "pointer", WALK.roots)
    target["extensions"] = {"KHR_animation_pointer": {"pointer": "/materials/0/emissiveFactor"}}
    rig.doc["extensionsUsed"] = ["KHR_animation_pointer"]
    yield Kind(group, "`KHR_animation_pointer`", "pointer.glb", rig.glb(), WALK, before)
    rig = formats.Gltf(WALK)
    names = ["KHR_materials_variants", "KHR_draco_mesh_compression"]
    rig.doc |= {"extensionsUsed": names, "extensionsRequired": names}
    yield Kind(group, "`extensionsRequired` of materials", "required_extension.glb", rig.glb(), WALK, before)
    rig = formats.Gltf(WALK)
    rig.node(on=WALK.names.index("Hand_L"), name="Sword", scale=[-1, 1, 1])
    rig.move(rig.node(name="Shield", scale=[1, -2, 1]), "translation", WALK.roots)
    yield Kind(group, "props of negative scale", "props.glb", rig.glb(), WALK, before)
    data, blob = formats.Gltf(WALK).gltf("walk.bin")
    yield Kind("`.gltf`", "with a file beside it", "walk.gltf", data, WALK, "not read", beside={"walk.bin": blob})
    yield Kind("`.fbx`", "text", "walk.fbx", formats.fbx(WALK), WALK, "not read")


def slide(by_m: float, joint: str = "Chest", scale: float = 1.0) -> tuple[Motion, formats.Gltf]:
    """A rig whose joint slides in its parent, and the motion with that joint in its mean place.

    With a scale, all stands in an Armature that is Z up and has this scale.
    """
    nth = WALK.names.index(joint)
    places = np.tile(WALK.offsets[nth], (len(WALK.roots), 1))
    places[:, 1] += by_m * np.sin(np.linspace(0, 6 * np.pi, len(places)))
    held = WALK.offsets.copy()
    held[nth] = (places.min(0) + places.max(0)) / 2 if by_m > 0.1 else places.mean(0)
    source = replace(WALK, offsets=WALK.offsets / scale, roots=WALK.roots / scale)
    if scale != 1:
        source = turned((1, 0, 0), np.pi / 2, source)
    rig = formats.Gltf(source)
    rig.move(nth, "translation", places / scale)
    if scale != 1:
        half = np.sqrt(0.5)
        rig.doc["nodes"].append(
            {"name": "Armature", "children": [0], "scale": [scale] * 3, "rotation": [-half, 0, 0, half]}
        )
        rig.doc["scenes"][0]["nodes"] = [len(rig.doc["nodes"]) - 1]
    return replace(WALK, offsets=held), rig


def robots() -> Iterator[Kind]:
    """Robots' numbers and descriptions."""
    robot = humanoid()
    clip, rows = robot.walk(0.85)

    def kind(name: str, file: str, data: bytes, before: str, **more: Any) -> Kind:
        return Kind("robots' numbers", name, file, data, clip, before, **{"robot": robot, "open_rate": True, **more})

    before = "on its head, toes at 1.46 m"
    wxyz = rows.copy()
    wxyz[:, 3:7] = np.roll(rows[:, 3:7], 1, axis=1)
    yield kind("CSV with w x y z", "wxyz.csv", formats.csv(wxyz), before)
    yield kind("`qpos` with x y z w", "xyzw.npy", formats.npy(rows), before, options={"quaternion": "xyzw"})
    degrees = rows.copy()
    degrees[:, 7:] = np.degrees(rows[:, 7:])
    yield kind("degrees", "degrees.csv", formats.csv(degrees), "nonsense, said to be feasible")
    stands = wxyz.copy()
    stands[:, :3] = wxyz[0, :3]
    turn = np.broadcast_to(about((0, 0, 1), np.pi), (len(rows), 4))
    stands[:, 3:7] = multiply(turn, wxyz[:, 3:7])
    turns = clip.turns.copy()
    turns[:, 0] = stands[:, [3, 5, 6, 4]]
    yield replace(
        kind(
            "w x y z, stands and faces backwards",
            "stands.csv",
            formats.csv(stands),
            "faces ahead, no note",
            options={"quaternion": "wxyz"},
        ),
        truth=replace(clip, roots=np.tile(clip.roots[:1], (len(rows), 1)), turns=turns),
        open_order=True,
    )
    breadth = rows.copy()
    breadth[:, 7:] = rows[:, 7:][:, robot.breadth_first()]
    yield kind("Isaac Lab's order", "order.csv", formats.csv(breadth), "nonsense, said to be feasible")
    fast, fast_rows = robot.walk(0.85, 120, 60.0)
    data = formats.csv(fast_rows)
    yield replace(kind("60 fps", "fps60.csv", data, "half speed", options={"fps": 60.0}), truth=fast)
    yield kind("Kimodo's CSV", "kimodo.csv", formats.csv(wxyz), "on its head")
    slow, slow_rows = robot.walk(0.85, 60, 25.0)
    slow_rows[:, 3:7] = np.roll(slow_rows[:, 3:7], 1, axis=1)
    data = formats.csv(slow_rows)
    yield replace(kind("ARDY's CSV, 25 fps", "ardy.csv", data, "on its head", options={"fps": 25.0}), truth=slow)

    group = "robots' descriptions"
    head = humanoid(Joint("head_pitch", "waist_yaw", (0, 0.031, 0.45), lower=-0.6, upper=0.6))
    for name, made, before in (
        ("head hinge off its axis, `--mirror`", head, "63 mm off the mirror image"),
        ("mimic joints", _gripper(), "refused"),
        ("legs `leg_l1` to `leg_l6`", kuavo(), "refused; the advice did not work"),
        ("four legs (Go2)", go2(), "refused; the advice did not work"),
    ):
        clip, rows = made.walk(0.85)
        yield Kind(
            group, name, f"walk{len(made.joints)}.csv", formats.csv(rows), clip, before, robot=made, legs=made.legs,
            mirror=made is head, open_rate=True,
        )  # fmt: skip


def _gripper() -> Robot:
    """A robot with a finger that turns against its elbow, by half."""
    return humanoid(Joint("left_finger", "left_elbow", (0.05, 0, -0.2), follows=("left_elbow", -0.5), lower=0, upper=1))


def texts() -> Iterator[Kind]:
    """BVH texts that programs write in many ways."""
    time = f"Frame Time: {1 / 30:.9f}"
    count = len(WALK.roots)
    head, rows = TEXT.split(time + "\n")
    prop = "ROOT Prop\n{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n}\nMOTION"
    two = head.replace("MOTION", prop) + time + "\n" + "".join(f"{row} 0 0 0\n" for row in rows.splitlines())
    head_6 = head.replace("CHANNELS 3", "CHANNELS 6 Xposition Yposition Zposition")
    turns = [row.split() for row in rows.splitlines()]
    rows_6 = [
        " ".join([*row[:6], *(f"0 0 0 {' '.join(row[n : n + 3])}" for n in range(6, len(row), 3))]) for row in turns
    ]
    zeros = f"{head_6}{time}\n" + "\n".join(rows_6) + "\n"
    texts: dict[str, tuple[str, bytes, dict[str, Any]]] = {
        "BOM": ("bom.bvh", b"\xef\xbb\xbf" + TEXT.encode(), {}),
        "UTF-16": ("utf16.bvh", TEXT.encode("utf-16"), {}),
        "`ZPosition`": ("position.bvh", TEXT.replace("position", "Position").encode(), {}),
        "two roots": ("two_roots.bvh", two.encode(), {}),
        "positions of 0 beside OFFSET": ("zeros.bvh", zeros.encode(), {}),
        "Frame Time 0": ("time0.bvh", TEXT.replace(time, "Frame Time: 0").encode(), {"fps": 30.0}),
        "Frames one too many": ("more.bvh", TEXT.replace(f"Frames: {count}", f"Frames: {count + 1}").encode(), {}),
        "Frames one too few": ("fewer.bvh", TEXT.replace(f"Frames: {count}", f"Frames: {count - 1}").encode(), {}),
    }
    for name, (file, data, options) in texts.items():
        before = "bones without length" if file == "zeros.bvh" else "three answers, bare tracebacks"
        yield Kind("text of BVH", name, file, data, WALK, before, options)


def archives() -> Iterator[Kind]:
    """NumPy archives."""
    before = '"specified file not found in archive"'
    for name, width, rate in (("SMPL-H", 156, "mocap_framerate"), ("SMPL-X", 165, "mocap_frame_rate")):
        data, clip = amass(width, rate)
        yield Kind("AMASS npz", name, f"amass{width}.npz", data, clip, before)
    data, clip = amass(72, "fps", y_up=True)
    yield Kind("AMASS npz", "Y up, in Fortran's order", "amass_y.npz", data, clip, before)

    def spread(nth: int) -> Array:
        return np.array([0.03 * (nth % 5 - 2), 0.06, -0.01 * (nth % 3)]) if nth else np.zeros(3)

    for name, tree, fps in (
        ("SOMA", SOMA, 30.0),
        ("SMPL-X", SMPL, 30.0),
        ("G1", G1, 30.0),
        ("ARDY's, 25 fps", SOMA, 25.0),
    ):
        clip = swinging(tree, fps, spread)
        places, turns = clip.world()
        data = formats.npz(posed_joints=places.astype(np.float32), global_rot_mats=matrix(turns).astype(np.float32))
        options = {"fps": fps} if fps != 30 else {}
        file = f"kimodo{len(clip.names)}_{fps:.0f}.npz"
        yield Kind("Kimodo npz", name, file, data, clip, before, options, open_rate=True)
    robot = humanoid()
    clip, rows = robot.walk(0.85, 100, 50.0)
    order = robot.breadth_first()
    places, turns = clip.world()
    to_ros = [2, 0, 1]  # ahead, left, up of left, up, ahead
    hinges = [robot.hinges()[nth] for nth in order]
    bodies = [0] + [clip.names.index(joint.name) for joint in hinges]
    data = formats.npz(
        fps=np.array([50]),
        joint_pos=np.ascontiguousarray(rows[:, 7:][:, order], np.float32),
        body_pos_w=places[:, bodies][..., to_ros].astype(np.float32),
        body_quat_w=turns[:, bodies][..., [0, 3, 1, 2]].astype(np.float32),
    )
    yield Kind("BeyondMimic npz", "", "mimic.npz", data, clip, before, robot=robot)


def amass(width: int, rate: str, y_up: bool = False) -> tuple[bytes, Motion]:
    """AMASS's arrays, Z up if not said otherwise. Its bones are the mean body's, which the caller fills in."""
    frames, by_rad = (300, 0.1) if y_up else (120, 0.3)
    clip = swinging(SMPL, 120.0, lambda _: np.zeros(3), frames, by_rad)
    standing = clip if y_up else turned((1, 0, 0), np.pi / 2, clip)
    half = np.arccos(np.clip(standing.turns[..., :1], -1, 1))
    vectors = standing.turns[..., 1:] / np.maximum(np.sin(half), 1e-12) * 2 * half
    poses = np.zeros((frames, width), order="F" if y_up else "C")
    poses[:, : 3 * len(clip.names)] = vectors.reshape(frames, -1)
    # The mean body's pelvis stands beside the origin that `trans` moves. SMPL-X has another.
    pelvis = np.array([0.0031, -0.3514, 0.0120] if width == 165 else [-0.0018, -0.2233, 0.0282])
    data = formats.npz(
        trans=np.ascontiguousarray(standing.roots - pelvis), poses=poses, betas=np.zeros(16), **{rate: 120.0}
    )
    return data, clip
