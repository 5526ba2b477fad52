"""Robots that are known: their URDF, and motion of their hinges."""

from dataclasses import dataclass, field

import numpy as np

from motion import Array, Motion, about, multiply


@dataclass
class Joint:
    """A hinge of a URDF, in ROS axes, metres and radians."""

    name: str
    parent: str
    xyz: tuple[float, float, float]
    axis: tuple[float, float, float] = (0, 1, 0)
    lower: float = -0.5
    upper: float = 0.5
    follows: tuple[str, float] | None = None  # another joint, and how far it turns by that one's angle


@dataclass
class Robot:
    """Hinges, parents first, in the order of a walk through the tree."""

    joints: list[Joint]
    legs: list[str] = field(default_factory=list)  # last hinges, left before right

    def urdf(self) -> str:
        """The text, with feet at the ends of what has no other joint."""
        parts = ['<robot name="made"><link name="base"/>']
        for joint in self.joints:
            box = '<collision><geometry><box size="0.2 0.1 0.04"/></geometry></collision>'
            parent = "base" if joint.parent == "base" else f"{joint.parent}_link"
            follows = ""
            if joint.follows:
                follows = f'<mimic joint="{joint.follows[0]}_joint" multiplier="{joint.follows[1]}"/>'
            parts.append(
                f'<link name="{joint.name}_link">{box}</link><joint name="{joint.name}_joint" type="revolute">'
                f'<parent link="{parent}"/><child link="{joint.name}_link"/><origin xyz="{_words(joint.xyz)}"/>'
                f'<axis xyz="{_words(joint.axis)}"/>{follows}'
                f'<limit lower="{joint.lower}" upper="{joint.upper}" effort="1" velocity="20"/></joint>'
            )
        return "\n".join([*parts, "</robot>\n"])

    def hinges(self) -> list[Joint]:
        """The joints that have an angle of their own."""
        return [joint for joint in self.joints if joint.follows is None]

    def angles(self, frames: int, fps: float) -> Array:
        """`[F, H]`: every hinge swings within its limits."""
        t = np.arange(frames) / fps
        swings = []
        for nth, joint in enumerate(self.hinges()):
            middle, half = (joint.lower + joint.upper) / 2, (joint.upper - joint.lower) / 2
            swings.append(middle + 0.6 * half * np.sin(4 * t + nth))
        return np.stack(swings, -1)

    def walk(self, height_m: float, frames: int = 60, fps: float = 30.0) -> tuple[Motion, Array]:
        """A way ahead on a curve: the motion, and rows x y z, qx qy qz qw, angles in ROS axes."""
        t, angles = np.arange(frames) / fps, self.angles(frames, fps)
        yaw = 0.3 * t
        places = np.stack([1.2 * np.sin(yaw) / 0.3, 1.2 * (1 - np.cos(yaw)) / 0.3, np.full(frames, height_m)], -1)
        root = multiply(about((0, 0, 1), yaw), about((0, 1, 0), 0.1 * np.sin(3 * t)))
        own = dict(zip([joint.name for joint in self.hinges()], angles.T, strict=True))
        names, turns = ["base"], [root]
        for joint in self.joints:
            angle = own[joint.follows[0]] * joint.follows[1] if joint.follows else own[joint.name]
            names.append(joint.name)
            turns.append(about(joint.axis, angle))
        parents = [-1] + [names.index(joint.parent) for joint in self.joints]
        offsets = np.array([(0, 0, 0)] + [joint.xyz for joint in self.joints], np.float64)
        to_native = [1, 2, 0]  # left, up, ahead of ahead, left, up
        quaternions = np.stack(turns, 1)[..., [0, 2, 3, 1]]
        rows = np.concatenate([places, root[:, [1, 2, 3, 0]], angles], 1)
        return Motion(names, parents, offsets[:, to_native], fps, places[:, to_native], quaternions), rows

    def breadth_first(self) -> list[int]:
        """Hinges in Isaac Lab's order: all that are nearest to the root, then the next."""
        depth = {"base": 0}
        for joint in self.joints:
            depth[joint.name] = depth[joint.parent] + 1
        hinges = self.hinges()
        return sorted(range(len(hinges)), key=lambda nth: depth[hinges[nth].name])


def _words(numbers: tuple[float, ...]) -> str:
    return " ".join(str(number) for number in numbers)


def _leg(side: str, y: float, names: tuple[str, str, str, str]) -> list[Joint]:
    hip, roll, knee, ankle = (word.replace("*", side) for word in names)
    return [
        Joint(hip, "base", (0, y, -0.1), lower=-1.5, upper=0.3),
        Joint(roll, hip, (0, 0, -0.05), (1, 0, 0), -0.3, 0.3),
        Joint(knee, roll, (0, 0, -0.35), lower=0.2, upper=2.2),
        Joint(ankle, knee, (0, 0, -0.35), lower=-0.9, upper=0.4),
    ]


def humanoid(*more: Joint, names: tuple[str, str, str, str] | None = None, sides: str = "left right") -> Robot:
    """Two legs, a waist and two arms, and more joints."""
    words = names or ("*_hip_pitch", "*_hip_roll", "*_knee", "*_ankle_pitch")
    first, second = sides.split()
    joints = _leg(first, 0.1, words) + _leg(second, -0.1, words)
    joints.append(Joint("waist_yaw", "base", (0, 0, 0.1), (0, 0, 1), -0.8, 0.8))
    for side, y in (("left", 0.2), ("right", -0.2)):
        joints.append(Joint(f"{side}_shoulder_pitch", "waist_yaw", (0, y, 0.3), lower=-2.0, upper=1.0))
        joints.append(Joint(f"{side}_elbow", f"{side}_shoulder_pitch", (0, 0, -0.25), lower=-1.8, upper=-0.2))
    ends = [words[3].replace("*", side) for side in (first, second)]
    return Robot(joints + list(more), ends)


def go2() -> Robot:
    """Four legs, as Unitree's Go2 names them."""
    joints = []
    for leg, x, y in (("FL", 0.19, 0.05), ("FR", 0.19, -0.05), ("RL", -0.19, 0.05), ("RR", -0.19, -0.05)):
        side = 0.1 if y > 0 else -0.1
        joints += [
            Joint(f"{leg}_hip", "base", (x, y, 0), (1, 0, 0), -0.6, 0.6),
            Joint(f"{leg}_thigh", f"{leg}_hip", (0, side, 0), lower=-0.2, upper=1.6),
            Joint(f"{leg}_calf", f"{leg}_thigh", (0, 0, -0.21), lower=-2.4, upper=-1.0),
        ]
    return Robot(joints, ["FL_calf", "FR_calf"])


def kuavo() -> Robot:
    """Legs whose joints have numbers: leg_l1 to leg_l6."""
    joints = []
    for side, y in (("l", 0.1), ("r", -0.1)):
        before = "base"
        for nth in range(1, 7):
            name = f"leg_{side}{nth}"
            xyz = (0.0, y, -0.1) if nth == 1 else (0, 0, -0.15)
            low, high = (-0.1, 0.1) if nth != 4 else (0.2, 1.4)
            joints.append(Joint(name, before, xyz, (1, 0, 0) if nth in (1, 6) else (0, 1, 0), low, high))
            before = name
    return Robot(joints, ["leg_l6", "leg_r6"])
