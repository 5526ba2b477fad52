"""``prepare``: a folder of BVH files -> cached arrays that training reads.

The cache holds, for all clips end to end: world joint positions ``[F, J, 3]`` (metres), world rotations in 6D
``[F, J, 6]``, headings ``[F]``, contacts ``[F, C]``; ``clips.json`` says which frames belong to which clip, which clips
were dropped and why; ``skeleton.json`` is the skeleton that all kept clips share.
"""

import hashlib
import json
import re
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
from tqdm import tqdm

from troupe_training.bvh import Bvh, BvhError, read_bvh
from troupe_training.skeleton import Skeleton

FPS = 30.0
MIN_CLIP_FRAMES = 16
MAX_JOINT_SPEED_MPS = 20.0
MAX_BELOW_GROUND_M = 0.15
MAX_OFFSET_ERROR_M = 0.02
CONTACT_HEIGHT_MARGIN_M = 0.05
CONTACT_MAX_SPEED_MPS = 0.4


def in_test_split(name: str) -> bool:
    """True for the 5 % of clips kept for testing, chosen by a hash of the file's name."""
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:4], "big") % 20 == 0


def _pelvis(bvh: Bvh, local_positions: np.ndarray, rotations: np.ndarray) -> int:
    """The joint that is the character's root: below joints (``joint_Root``) that only carry it, standing or moving.

    A joint carries its only child where the child has a position of its own and either the joint never moves or the
    child moves relative to it.
    """
    positions = {"Xposition", "Yposition", "Zposition"}
    joint = 0
    while sum(j.parent == joint for j in bvh.joints) == 1 and positions <= set(
        bvh.joints[joint + 1].channels
    ):
        tolerance = 1e-3 * max(np.abs(local_positions).max(), 1e-9)
        still = max(np.ptp(v[:, joint], axis=0).max() for v in (local_positions, rotations)) < 1e-6
        carried = np.ptp(local_positions[:, joint + 1], axis=0).max() > tolerance
        if not (still or carried):
            break
        joint += 1
    return joint


def _side_pair(names: list[str], parents: list[int]) -> tuple[int, int]:
    """The left and the right hip: two children of the root whose names differ in the side alone."""
    hips = [j for j, p in enumerate(parents) if p == 0]
    for left in hips:
        mirrored = {
            pattern.sub(other, names[left], count=1)
            for pattern, other in _SIDES
            if pattern.search(names[left])
        }
        for right in hips:
            if right != left and names[right] in mirrored:
                return left, right
    raise BvhError(f"cannot tell the left from the right hip among {[names[j] for j in hips]}")


_SIDES = (
    (re.compile("Left"), "Right"),
    (re.compile("left"), "right"),
    (re.compile("LEFT"), "RIGHT"),
    (re.compile(r"([_.:-])L$"), r"\1R"),
    (re.compile(r"([_.:-])l$"), r"\1r"),
    (re.compile(r"(^|[_.:-])L(?=[A-Z_.:-])"), r"\1R"),
    (re.compile(r"(^|[_.:-])l(?=[A-Z_.:-])"), r"\1r"),
)


def load_clip(path: Path, scale: float | None = None) -> dict:
    """Parses one file to metres and 30 fps. Raises `BvhError` with the reason where it cannot be used."""
    bvh = read_bvh(path)
    positions, rotations, local = bvh.world()
    first = _pelvis(bvh, local, rotations)
    positions, rotations, local = positions[:, first:], rotations[:, first:], local[:, first:]
    joints = bvh.joints[first:]
    if scale is None:  # a pelvis more than ten units high can only be in centimetres
        scale = 0.01 if np.median(np.abs(positions[:, 0, 1])) > 10 else 1.0
    positions, local = positions * scale, local * scale
    if len(joints) > 1 and np.ptp(local[:, 1:], axis=0).max() > 1e-3:
        raise BvhError("bones change length over time")
    positions, rotations = _resample(positions, rotations, bvh.frame_time)
    if len(positions) < MIN_CLIP_FRAMES:
        raise BvhError(f"only {len(positions)} frames, at least {MIN_CLIP_FRAMES} are needed")
    speed = np.linalg.norm(np.diff(positions, axis=0), axis=-1).max() * FPS
    if speed > MAX_JOINT_SPEED_MPS:
        raise BvhError(f"a joint moves at {speed:.1f} m/s, at most {MAX_JOINT_SPEED_MPS:.0f} is believed")
    if positions[..., 1].min() < -MAX_BELOW_GROUND_M:
        raise BvhError(f"a joint is {-positions[..., 1].min():.2f} m below the ground")
    return {
        "names": [j.name for j in joints],
        "parents": [j.parent - first if j.parent >= first else -1 for j in joints],
        "offsets": local[0],
        "positions": positions.astype(np.float32),
        "six_d": np.concatenate([rotations[..., 0], rotations[..., 1]], -1).astype(np.float32),
    }


def _resample(
    positions: np.ndarray, rotations: np.ndarray, frame_time: float
) -> tuple[np.ndarray, np.ndarray]:
    """To 30 fps: linear positions, and rotations by the nearest matrix to the linear mean."""
    rate = 1.0 / frame_time
    if abs(rate - FPS) < 5e-4 * FPS or len(positions) < 2:
        return positions, rotations
    times = np.arange(0.0, len(positions) - 1 + 1e-6, rate / FPS)
    lower = np.minimum(times.astype(int), len(positions) - 2)
    share = times - lower

    def mix(values: np.ndarray) -> np.ndarray:
        weight = share.reshape((-1,) + (1,) * (values.ndim - 1))
        return values[lower] * (1 - weight) + values[lower + 1] * weight

    u, _, v = np.linalg.svd(mix(rotations))
    return mix(positions), u @ v


def _try_load(path: Path, scale: float | None) -> dict:
    try:
        return {"path": path.name} | load_clip(path, scale)
    except (BvhError, ValueError, LookupError, ArithmeticError, OSError, MemoryError) as error:
        return {"path": path.name, "reason": str(error) or type(error).__name__}


def _skeleton_of(clips: list[dict], contact_names: list[str] | None) -> Skeleton:
    names, parents = clips[0]["names"], clips[0]["parents"]
    offsets = np.median([c["offsets"] for c in clips], axis=0)
    offsets[0] = 0.0
    left, right = _side_pair(names, parents)
    axis = offsets[left] - offsets[right]
    axis = np.round(axis / np.linalg.norm(axis), 3)
    if contact_names is None:
        contact_names = [n for n in names if any(w in n.lower() for w in ("foot", "toe", "ankle"))]
    unknown = [n for n in contact_names if n not in names]
    if unknown or not contact_names:
        raise BvhError(
            f"contact joints {unknown or '(none found by name)'} are not among {names}; set --contact-joints"
        )
    contacts = [names.index(n) for n in contact_names]
    heights = np.concatenate([c["positions"][:, contacts, 1] for c in clips])
    clearance = np.percentile(heights, 1.0, axis=0)
    return Skeleton(
        names=names,
        parents=parents,
        offsets=[[round(float(v), 6) + 0.0 for v in o] for o in offsets],
        left_axis=[float(v) for v in axis],
        contact_joints=contacts,
        contact_max_height_m=[round(float(h + CONTACT_HEIGHT_MARGIN_M), 4) for h in clearance],
        contact_max_speed_mps=CONTACT_MAX_SPEED_MPS,
        contact_clearance_m=[round(float(h), 4) for h in clearance],
    )


def headings(six_d: np.ndarray, left_axis: np.ndarray) -> np.ndarray:
    """Heading of each frame from the pelvis rotation: left x up, projected on the ground."""
    pelvis = six_d[:, 0].astype(np.float64)
    x, y = pelvis[:, :3], pelvis[:, 3:]
    matrix = np.stack([x, y, np.cross(x, y)], -1)
    left = matrix @ left_axis
    return np.arctan2(-left[:, 2], left[:, 0])


def detect_contacts(positions: np.ndarray, skeleton: Skeleton) -> np.ndarray:
    """``[F, C]`` of 0/1: a contact joint that is low and slow stands on the ground."""
    feet = positions[:, skeleton.contact_joints]
    speed = np.linalg.norm(np.diff(feet, axis=0, prepend=feet[:1]), axis=-1) * FPS
    if len(speed) > 1:
        speed[0] = speed[1]
    low = feet[..., 1] < np.array(skeleton.contact_max_height_m)
    return (low & (speed < skeleton.contact_max_speed_mps)).astype(np.float32)


def prepare(
    source: Path,
    cache: Path,
    contact_names: list[str] | None = None,
    scale: float | None = None,
    workers: int = 1,
    split_list: Path | None = None,
) -> None:
    """Builds the cache and prints what was kept and what was dropped, by name and reason.

    ``split_list`` also gets the names of the test clips, one a line.
    """
    files = sorted(path for path in Path(source).rglob("*") if path.suffix.lower() == ".bvh")
    if not files:
        raise SystemExit(f"no .bvh file under {source}")
    with ProcessPoolExecutor(workers) as pool:
        results = pool.map(partial(_try_load, scale=scale), files, chunksize=8)
        loaded = list(tqdm(results, total=len(files), desc="prepare"))
    clips = [c for c in loaded if "reason" not in c]
    dropped = {c["path"]: c["reason"] for c in loaded if "reason" in c}
    if not clips:
        raise SystemExit(f"none of {len(files)} files can be used, e.g. {next(iter(dropped.items()))}")
    reference = clips[0]["names"]
    for clip in [c for c in clips if c["names"] != reference]:
        dropped[clip["path"]] = "another skeleton than the first clip's"
    clips = [c for c in clips if c["names"] == reference]
    usual = np.median([c["offsets"] for c in clips], axis=0)
    for clip in clips:
        error = np.abs(clip["offsets"] - usual)[1:].max(initial=0.0)
        if error > MAX_OFFSET_ERROR_M:
            dropped[clip["path"]] = f"a bone is {error:.3f} m off the usual length"
    clips = [c for c in clips if c["path"] not in dropped]
    try:
        skeleton = _skeleton_of(clips, contact_names)
    except BvhError as error:
        raise SystemExit(str(error)) from error

    cache = Path(cache)
    cache.mkdir(parents=True, exist_ok=True)
    skeleton.save(cache / "skeleton.json")
    left = np.array(skeleton.left_axis)
    np.save(cache / "positions.npy", np.concatenate([c["positions"] for c in clips]))
    np.save(cache / "six_d.npy", np.concatenate([c["six_d"] for c in clips]))
    np.save(
        cache / "headings.npy", np.concatenate([headings(c["six_d"], left) for c in clips]).astype(np.float32)
    )
    np.save(
        cache / "contacts.npy", np.concatenate([detect_contacts(c["positions"], skeleton) for c in clips])
    )
    start, index = 0, []
    for clip in clips:
        length = len(clip["positions"])
        index.append(
            {"name": clip["path"], "start": start, "frames": length, "test": in_test_split(clip["path"])}
        )
        start += length
    (cache / "clips.json").write_text(
        json.dumps({"source": str(Path(source).resolve()), "clips": index, "dropped": dropped}, indent=1)
    )
    if split_list is not None:
        split_list.write_text("".join(c["name"] + "\n" for c in index if c["test"]))
    test = sum(c["test"] for c in index)
    hours = start / FPS / 3600
    print(
        f"{len(index)} clips, {hours:.2f} hours; {len(index) - test} to train, {test} to test; {len(dropped)} dropped"
    )
    for name, reason in dropped.items():
        print(f"dropped {name}: {reason}")
