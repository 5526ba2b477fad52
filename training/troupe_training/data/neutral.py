"""The neutral pose of a body: upright, heading +Z, arms and legs hanging down.

Robots have it by their hinges, from the URDF alone. Characters that come with motion have it by their average pose, whose
limbs are then straightened. Rigs with a rest pose of their own (glTF) keep that.
"""

import numpy as np

from troupe_training.data.rotations import columns_to_matrix
from troupe_training.data.sides import side_pairs
from troupe_training.data.skeleton import HingeTable, MimicTable, Skeleton

STEP_RAD = np.radians(2.0)
# Metres that a hand must sink for a hinge to turn by one radian (squared): those that need not
# turn, stay.
STIFFNESS_M = 0.01
SWEEPS = 3


def robot_neutral(skeleton: Skeleton) -> np.ndarray:
    """World rotations ``[J, 3, 3]``: hinges at 0, and arms turned so that their hands hang lowest within the limits."""
    assert skeleton.robot is not None
    hinges = {skeleton.names.index(h["joint"]): h for h in skeleton.robot["hinges"]}
    angles = dict.fromkeys(hinges, 0.0)
    for j, hinge in hinges.items():
        angles[j] = float(np.clip(0.0, hinge["lower_rad"], hinge["upper_rad"]))
    feet = {above for j in skeleton.contact_joints for above in _chain(skeleton, j)}
    for left, right in side_pairs(skeleton.names):
        for hand in (left, right):
            if hand not in skeleton.parents and hand not in feet:
                chain = [j for j in _chain(skeleton, hand) if j in hinges and j not in feet and _is_sided(skeleton, j)]
                _hang(skeleton, hinges, angles, chain, hand)
    return _robot_pose(skeleton, hinges, angles)[1]


def _is_sided(skeleton: Skeleton, joint: int) -> bool:
    return any(joint in pair for pair in side_pairs(skeleton.names))


def _chain(skeleton: Skeleton, joint: int) -> list[int]:
    """A joint and its ancestors below the root."""
    chain = []
    while joint > 0:
        chain.append(joint)
        joint = skeleton.parents[joint]
    return chain


def _hang(
    skeleton: Skeleton, hinges: dict[int, HingeTable], angles: dict[int, float], chain: list[int], hand: int
) -> None:
    for _ in range(SWEEPS):
        for joint in chain:
            lower, upper = hinges[joint]["lower_rad"], hinges[joint]["upper_rad"]
            tried = np.append(np.arange(np.ceil(lower / STEP_RAD), upper / STEP_RAD) * STEP_RAD, angles[joint])
            costs = []
            for angle in tried:
                places, _ = _robot_pose(skeleton, hinges, angles | {joint: float(angle)})
                costs.append(places[hand, 1] + STIFFNESS_M * angle**2)
            angles[joint] = float(tried[int(np.argmin(costs))])


def _robot_pose(
    skeleton: Skeleton, hinges: dict[int, HingeTable], angles: dict[int, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Positions ``[J, 3]`` and world rotations ``[J, 3, 3]`` at hinge angles."""
    places, turned = np.zeros((skeleton.joint_count, 3)), np.tile(np.eye(3), (skeleton.joint_count, 1, 1))
    turning: dict[int, tuple[HingeTable | MimicTable, float]] = {j: (hinge, angles[j]) for j, hinge in hinges.items()}
    for mimic in skeleton.robot.get("mimics", []) if skeleton.robot is not None else []:
        angle = mimic["multiplier"] * angles[skeleton.names.index(mimic["follows"])] + mimic["offset_rad"]
        turning[skeleton.names.index(mimic["joint"])] = mimic, angle
    for j in range(1, skeleton.joint_count):
        parent = skeleton.parents[j]
        places[j] = places[parent] + turned[parent] @ np.array(skeleton.offsets[j])
        turned[j] = turned[parent]
        if j in turning:
            table, angle = turning[j]
            rest, half = quaternion_matrix(np.array(table["rest"])), angle / 2
            turn = np.append(np.cos(half), np.sin(half) * np.array(table["axis"]))
            turned[j] = turned[parent] @ rest @ quaternion_matrix(turn)
    return places, turned


def quaternion_matrix(quat: np.ndarray) -> np.ndarray:
    """Unit quaternions (w, x, y, z) ``[..., 4]`` to ``[..., 3, 3]``, in numpy."""
    w, x, y, z = np.moveaxis(quat, -1, 0)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, -1) for row in rows], -2)


def average_pose(six_d: list[np.ndarray], left_axis: list[float]) -> np.ndarray:
    """The mean of world rotations in clips ``[F, J, 6]``, each frame turned to heading 0: ``[J, 3, 3]``."""
    total: np.ndarray | float = 0.0
    for clip in six_d:
        matrices = columns_to_matrix(clip)
        left = matrices[:, 0] @ np.array(left_axis)
        heading = np.arctan2(-left[:, 2], left[:, 0])
        total = total + np.einsum("fik,fjkl->jil", yaw(-heading), matrices)
    u, _, v = np.linalg.svd(np.asarray(total))
    return u @ v


def yaw(psi: np.ndarray) -> np.ndarray:
    """Rotations about +Y ``[F, 3, 3]``, which take +Z to (sin psi, 0, cos psi)."""
    c, s, zero, one = np.cos(psi), np.sin(psi), np.zeros_like(psi), np.ones_like(psi)
    return np.stack([np.stack([c, zero, s], -1), np.stack([zero, one, zero], -1), np.stack([-s, zero, c], -1)], -2)


def straightened(skeleton: Skeleton, pose: np.ndarray) -> np.ndarray:
    """A biped's average pose ``[J, 3, 3]`` made upright: the trunk up, arms and legs down, feet as they are.

    Limbs are chains of joints with left and right names. The first bone of one (to the hip, to the shoulder) keeps its
    place, those beyond hang down; bones beyond an ankle keep their slope and point ahead.
    """
    pairs = side_pairs(skeleton.names)
    sided = {j for pair in pairs for j in pair}
    ankles = _ankles(skeleton)
    out = pose.copy()
    out[0] = _nearest_upright(pose[0], skeleton)
    for j in range(1, skeleton.joint_count):
        children = [k for k, parent in enumerate(skeleton.parents) if parent == j]
        parent = skeleton.parents[j]
        # The parent's turn takes the joint along.
        out[j] = out[parent] @ pose[parent].T @ pose[j]
        if len(children) == 0:
            continue
        bones = [np.array(skeleton.offsets[k]) for k in children if (k in sided) == (j in sided)]
        bone = np.mean(bones, 0) if bones else np.zeros(3)
        if np.linalg.norm(bone) < 1e-6:
            continue
        direction = out[j] @ bone / np.linalg.norm(bone)
        limb = j in sided and skeleton.parents[j] >= 0
        first = limb and (parent not in sided) and not _is_leg(skeleton, j)
        if j in ankles:
            wanted = np.array([0.0, direction[1], np.hypot(direction[0], direction[2])])
        elif first:
            continue
        elif limb:
            wanted = np.array([0.0, -1.0, 0.0])
        else:
            wanted = np.array([0.0, 1.0, 0.0])
        out[j] = _turn(direction, wanted) @ out[j]
    return out


def _is_leg(skeleton: Skeleton, joint: int) -> bool:
    return any(joint in _chain(skeleton, foot) for foot in skeleton.contact_joints)


def _ankles(skeleton: Skeleton) -> set[int]:
    """Contact joints that carry another contact joint."""
    return {skeleton.parents[j] for j in skeleton.contact_joints} & set(skeleton.contact_joints)


def _nearest_upright(rotation: np.ndarray, skeleton: Skeleton) -> np.ndarray:
    """The root turned so that its left axis is +X and its trunk (the bone to a middle joint) as near +Y as can be."""
    left = rotation @ np.array(skeleton.left_axis)
    turn = _turn(left, np.array([1.0, 0.0, 0.0]))
    middle = [j for j, parent in enumerate(skeleton.parents) if parent == 0 and not _is_sided(skeleton, j)]
    if middle:
        bone = turn @ rotation @ np.array(skeleton.offsets[middle[0]])
        bone[0] = 0.0
        if np.linalg.norm(bone) > 1e-6:
            turn = _turn(bone / np.linalg.norm(bone), np.array([0.0, 1.0, 0.0])) @ turn
    return turn @ rotation


def _turn(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The smallest rotation that takes one unit vector to another."""
    start, end = start / np.linalg.norm(start), end / np.linalg.norm(end)
    axis, cosine = np.cross(start, end), float(start @ end)
    if cosine < -1 + 1e-9:
        other = np.cross(start, [1.0, 0.0, 0.0] if abs(start[0]) < 0.9 else [0.0, 1.0, 0.0])
        return 2 * np.outer(other, other) / (other @ other) - np.eye(3)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + cross + cross @ cross / (1 + cosine)
