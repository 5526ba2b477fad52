"""A MotionBricks pack on VerMo's gaps: four frames before, and the first frame behind, as a server answers them.

It needs a frame to lead to. So it fills gaps and predicts nothing.
"""

from collections.abc import Callable
from pathlib import Path

import torch

from troupe_training.data.conventions import CONTEXT_FRAMES
from troupe_training.data.kinematics import Kinematics
from troupe_training.data.motion import Motion, pose_features
from troupe_training.data.skeleton import Skeleton
from troupe_training.evaluate import bench
from troupe_training.evaluate.motionbricks import of_networks, pack_networks
from troupe_training.evaluate.pinning import pin
from troupe_training.evaluate.vermo.answers import Clip
from troupe_training.evaluate.vermo.continuation import Window, moved
from troupe_training.export.manifest import read_manifest
from troupe_training.train.vermo.corpus import Motions

SAME_PLACE_M = 1e-4
Answers = Callable[[Motions, list[Window], bench.Sampling], list[Clip]]


def of_pack(pack: Path, skeleton: Skeleton, threads: int) -> Answers:
    """The networks of a pack of the same body, to fill gaps with; ends the command if the body is another."""
    own = Skeleton.of_manifest(read_manifest(pack))
    offsets = [torch.tensor(body.offsets) for body in (own, skeleton)]
    is_same = (own.names, own.parents, own.left_axis) == (skeleton.names, skeleton.parents, skeleton.left_axis)
    if not is_same or (offsets[0] - offsets[1])[1:].abs().max() > SAME_PLACE_M:
        raise SystemExit(f"{pack} moves another body than the cache has: figures would not compare")
    method = of_networks(pack_networks(pack, threads))
    return lambda motions, windows, sampling: filled(method, motions, windows, sampling)


def filled(method: bench.Method, motions: Motions, windows: list[Window], sampling: bench.Sampling) -> list[Clip]:
    """Windows of gaps of one length as a method of segments fills them, pinned to the frames that it is given."""
    clips: list[Clip] = []
    for first in range(0, len(windows), bench.BATCH):
        clips += _some_filled(method, motions, windows[first : first + bench.BATCH], sampling)
    return clips


def _some_filled(method: bench.Method, motions: Motions, windows: list[Window], sampling: bench.Sampling) -> list[Clip]:
    before, end = windows[0].before, len(windows[0].truth.pose) - windows[0].behind
    frames = bench.check_gap(end - before)
    starts = torch.tensor([window.crop.start + before - CONTEXT_FRAMES for window in windows])
    segments = motions.store.segments(starts, frames)
    index, truth = [*range(CONTEXT_FRAMES), frames - 1], Motion.of(segments)
    given = Motion(truth.root[:, index], truth.rotations[:, index])
    skeleton = motions.store.skeleton
    left_axis = torch.tensor(skeleton.left_axis)
    made = pin(method(segments, frames, sampling), given, index, skeleton.parents, left_axis)
    positions, six_d = pose_features(made, Kinematics(skeleton))
    poses, roots = torch.cat([positions, six_d], -1).flatten(2), made.global_root(left_axis)
    gap = slice(CONTEXT_FRAMES, frames - 1)
    clips = []
    for window, pose, root in zip(windows, poses, roots, strict=True):
        placed = moved(Clip(pose, root), CONTEXT_FRAMES - 1, window.truth.root[before - 1])
        whole = window.truth
        clips.append(
            Clip(
                torch.cat([whole.pose[:before], placed.pose[gap], whole.pose[end:]]),
                torch.cat([whole.root[:before], placed.root[gap], whole.root[end:]]),
            )
        )
    return clips
