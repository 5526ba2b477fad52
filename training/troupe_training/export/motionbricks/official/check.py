"""``check-motionbricks``: the public code and a pack made of the same weights answer the same requests, stage by stage.

The public code runs in an environment of its own (`reference`), on what a request means: places and rotations of joints. The
pack gets the request as the contract has it. Nothing of our conversions is on the other side.
"""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Generator, Tensor

from troupe_training.data.conventions import CONTEXT_FRAMES, MAX_TARGETS
from troupe_training.data.roots import local_root_of
from troupe_training.data.rotations import quat_to_matrix, yaw_matrix
from troupe_training.data.skeleton import Skeleton
from troupe_training.export.motionbricks.examples import Inputs
from troupe_training.export.motionbricks.official.checkpoints import ReleaseError
from troupe_training.export.motionbricks.official.pack import import_release, skeleton_of
from troupe_training.export.motionbricks.official.release import Release
from troupe_training.export.onnx import Session, largest_of
from troupe_training.models.motionbricks.official.served import UPRIGHT, Joints
from troupe_training.models.motionbricks.official.sizes import Sizes

TOLERANCE = 1e-4
HERE = Path(__file__).parent
HIP_HEIGHT_M, SPEED_MPS, BEND_RAD = 0.75, 1.0, 0.4


@dataclass
class Request:
    """A walk of random poses: joints in the pack's order, and which of its keyframes are given."""

    global_root: Tensor  # [T, 5]
    positions: Tensor  # [T, J, 3], world
    rotations: Tensor  # [T, J, 3, 3], world
    given: dict[str, Tensor]  # local_root, global_root, pose: 0/1 [slots]
    allowed: Tensor  # 0/1 [counts]

    @property
    def slots(self) -> list[int]:
        """Frames of keyframes."""
        frames = len(self.global_root)
        return [*range(CONTEXT_FRAMES), *range(frames - MAX_TARGETS, frames)]

    @property
    def pose(self) -> Tensor:
        """Pose features ``[T, 9 J]``."""
        ground = self.global_root[:, None, :3] * torch.tensor([1.0, 0.0, 1.0])
        columns = self.rotations[..., :2].transpose(-1, -2).flatten(-2)
        return torch.cat([self.positions - ground, columns], -1).flatten(1)

    def released(self, joints: Joints) -> dict[str, np.ndarray]:
        """As the public code reads it. Joints without a hinge are upright there."""
        theirs = torch.tensor([joints.theirs.index(joint) for joint in range(len(joints.theirs))])
        rotations = self.rotations[:, theirs].clone()
        rotations[:, joints.fixed] = torch.eye(3)
        tensors = {
            "global_root": self.global_root,
            "positions": self.positions[:, theirs],
            "rotations": rotations,
            "allowed_counts": self.allowed,
        }
        # Its local root at a slot is the velocity towards the next frame: known if both are given.
        local = self.given["local_root"].clone()
        local[:-1] *= self.given["local_root"][1:]
        local[CONTEXT_FRAMES - 1] = 0.0
        given = self.given | {"local_root": local}
        tensors |= {f"has_{name}": mask for name, mask in given.items()}
        return {name: tensor.numpy() for name, tensor in tensors.items()}

    def root_inputs(self) -> Inputs:
        """Of the pack's root stage."""
        frames = {"local_root": local_root_of(self.global_root), "global_root": self.global_root, "pose": self.pose}
        values = {f"key_{name}": (frames[name][self.slots] * self.given[name][:, None])[None] for name in frames}
        masks = {f"has_{name}": self.given[name][None] for name in frames}
        return values | masks | {"allowed_counts": self.allowed[None], "count_noise": torch.zeros(1, len(self.allowed))}

    def token_inputs(self, tokens: Tensor, frames_per_token: int) -> Inputs:
        """Of the later stages, on the walk's own trajectory."""
        frames = len(self.global_root)
        mask = torch.zeros(frames)
        mask[self.slots] = self.given["pose"]
        return {
            "tokens": tokens[None, : frames // frames_per_token].long(),
            "num_tokens": torch.tensor([frames // frames_per_token]),
            "global_root": self.global_root[None],
            "frame_pose": (self.pose * mask[:, None])[None],
            "frame_mask": mask[None],
        }


def random_request(skeleton: Skeleton, sizes: Sizes, tokens: int, generator: Generator) -> Request:
    """A walk of that many tokens, in the segment frame; some targets are left out."""
    frames, joints = tokens * sizes.frames_per_token, skeleton.joint_count

    def smooth(*shape: int) -> Tensor:
        """Random numbers of deviation one that change slowly along the frames."""
        seconds = torch.arange(frames)[:, None] / 30.0
        waves = torch.randn(3, 2, *shape, generator=generator).flatten(2)
        rates = torch.tensor([1.0, 2.5, 5.0])
        moving = [torch.sin(rate * seconds + wave[0]) * wave[1] for rate, wave in zip(rates, waves, strict=True)]
        return (torch.stack(moving).sum(0) / 3**0.5).reshape(frames, *shape)

    psi = smooth(1)[:, 0]
    psi = psi - psi[CONTEXT_FRAMES - 1]
    place = torch.cumsum(smooth(2) * SPEED_MPS / 30.0, 0)
    place = place - place[CONTEXT_FRAMES - 1]
    height = HIP_HEIGHT_M + 0.03 * smooth(1)[:, 0]
    root = torch.stack([place[:, 0], height, place[:, 1], torch.cos(psi), torch.sin(psi)], -1)
    quat = torch.nn.functional.normalize(
        torch.cat([torch.ones(frames, joints, 1), BEND_RAD * smooth(joints, 3)], -1), dim=-1
    )
    local = quat_to_matrix(quat)
    assert skeleton.robot is not None
    hinged = {hinge["joint"] for hinge in skeleton.robot["hinges"]}
    world: list[Tensor] = [yaw_matrix(psi) @ local[:, 0]]
    for joint in range(1, joints):
        above = world[skeleton.parents[joint]]
        world.append(above @ local[:, joint] if skeleton.names[joint] in hinged else above)
    rotations = torch.stack(world, 1)
    positions = torch.from_numpy(skeleton.forward_kinematics(root[:, :3].numpy(), rotations.numpy())).float()
    given = {}
    for name in ("local_root", "global_root", "pose"):
        given[name] = torch.ones(CONTEXT_FRAMES + MAX_TARGETS)
        given[name][CONTEXT_FRAMES:] = (torch.rand(MAX_TARGETS, generator=generator) < 0.6).float()
    allowed = (torch.rand(sizes.counts, generator=generator) < 0.5).float()
    allowed[tokens - sizes.min_tokens] = 1.0
    return Request(root, positions, rotations, given, allowed)


def environment(folder: Path) -> Path:
    """The Python of an environment with what the public code needs, made once."""
    python, wanted = folder / "bin" / "python", (HERE / "requirements.txt").read_text()
    note = folder / "installed.txt"
    if not note.exists() or note.read_text() != wanted:
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", "-r", HERE / "requirements.txt"], check=True)
        note.write_text(wanted)
    return python


def check_release(checkout: Path, work: Path, python: Path, like: Path) -> dict[str, float]:
    """The largest difference of each tensor. Files of the check are put into ``work``, a folder that is there."""
    code = next((c for c in (checkout, checkout / "motionbricks") if (c / "out" / "motionbricks_pose").is_dir()), None)
    if code is None:
        raise ReleaseError(f"{checkout} has no motionbricks/out/motionbricks_pose: expected a checkout")
    release = Release.read(code)
    skeleton, joints = skeleton_of(release, like)
    generator = Generator().manual_seed(7)
    counts = range(release.sizes.min_tokens, release.sizes.max_tokens + 1)
    requests = [random_request(skeleton, release.sizes, tokens, generator) for tokens in counts]
    arrays = {
        f"{number}/{name}": value
        for number, request in enumerate(requests)
        for name, value in request.released(joints).items()
    }
    np.savez(work / "requests.npz", count=np.array(len(requests)), **arrays)  # type: ignore[arg-type]
    subprocess.run([python, HERE / "reference.py", code, work / "requests.npz", work], check=True)
    pack = work / "pack"
    import_release(work / "release", pack, like, "0.0.0")
    return compare(pack, requests, np.load(work / "answers.npz"), joints, release.sizes)


def compare(
    pack: Path, requests: list[Request], answers: "np.lib.npyio.NpzFile", joints: Joints, sizes: Sizes
) -> dict[str, float]:
    """The pack's answers beside those of the public code."""
    worst: dict[str, float] = {}

    def note(name: str, ours: Tensor, theirs: Tensor) -> None:
        worst[name] = max(worst.get(name, 0.0), largest_of(ours.double() - theirs.double()))

    session = Session(pack / "root.onnx")
    for number, request in enumerate(requests):
        answered = _answered(answers, number, "root")
        made = session.run(request.root_inputs())
        frames = int(answered["num_tokens"]) * sizes.frames_per_token
        note("root: token count", made["num_tokens"], answered["num_tokens"])
        note("root: probabilities of counts", made["count_probs"][0], answered["count_probs"])
        note("root: trajectory", made["global_root"][0, :frames], answered["global_root"][:frames])
    session = Session(pack / "pose.onnx")
    for number, request in enumerate(requests):
        answered = _answered(answers, number, "pose")
        for step in range(len(answered) // 2):
            inputs = request.token_inputs(answered[f"tokens{step}"], sizes.frames_per_token)
            logits = session.run(inputs)["logits"][0]
            masked = "all masked" if step == 0 else "some masked"
            note(f"pose: logits, {masked}", logits, answered[f"logits{step}"][: len(logits)])
    session = Session(pack / "decoder.onnx")
    moving = [joint for joint, theirs in enumerate(joints.theirs) if theirs not in joints.fixed]
    theirs = torch.tensor(joints.theirs)[moving]
    for number, request in enumerate(requests):
        answered = _answered(answers, number, "decoder")
        made = session.run(request.token_inputs(answered["tokens"], sizes.frames_per_token))
        rotations = answered["rotations"].unflatten(-1, (-1, len(UPRIGHT)))[:, theirs]
        note("decoder: rotations", made["rotations"][0][:, moving], rotations)
        note("decoder: trajectory", made["refined_root"][0], answered["refined_root"])
        note("decoder: contacts", made["contacts"][0], answered["contacts"].clamp(0.0, 1.0))
    return worst


def _answered(answers: "np.lib.npyio.NpzFile", number: int, stage: str) -> dict[str, Tensor]:
    start = f"{number}/{stage}/"
    return {key.removeprefix(start): torch.from_numpy(answers[key]) for key in answers if key.startswith(start)}
