"""``import-motionbricks-planner``: the planner's ONNX file of the public release -> a model pack.

The file is one graph for everything: styles, spring and networks. The pack has it as it was published. The server translates: see
``engine/src/sonic_planner``.
"""

import json
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import onnx
import torch
from google.protobuf.message import DecodeError
from onnx import TensorProto, ValueInfoProto
from onnx.external_data_helper import uses_external_data

from troupe_training.data.bodies import Body, body_of
from troupe_training.data.neutral import robot_neutral
from troupe_training.data.skeleton import Skeleton
from troupe_training.export.bodies import write_body
from troupe_training.export.manifest import About, Family, read_manifest, write_manifest
from troupe_training.export.motionbricks.official.checkpoints import POINTER, ReleaseError
from troupe_training.export.motionbricks.official.pack import CREDITS, LICENCE
from troupe_training.export.motionbricks.pack import digest_of, settle
from troupe_training.export.onnx import Session

FAMILY = Family("sonic_planner", ("live",))
BODY = "g1"
CONTEXT_FRAMES, FRAMES_PER_TOKEN = 4, 4
MIN_TOKENS, MAX_TOKENS = 6, 16
COUNTS = MAX_TOKENS - MIN_TOKENS + 1
MAX_FRAMES = MAX_TOKENS * FRAMES_PER_TOKEN
RUN_TOKENS = (MIN_TOKENS, 9, MAX_TOKENS)  # plans that are made before a pack is written

# The modes in the order of their numbers, as NVIDIA's page on the file names them.
MODES = (
    *("idle", "slow-walk", "walk", "run", "squat", "kneel-two-leg", "kneel-one-leg", "lying-facedown", "hand-crawling"),
    *(
        "idle-boxing",
        "walk-boxing",
        "left-jab",
        "right-jab",
        "random-punches",
        "elbow-crawling",
        "left-hook",
        "right-hook",
    ),
    *(
        "happy",
        "stealth",
        "injured",
        "careful",
        "object-carrying",
        "crouch",
        "happy-dance",
        "zombie",
        "point",
        "scared",
    ),
)
DEFAULT_MODE = "walk"
# NVIDIA's controller makes these idle when the stick is released, and leaves the others.
WALKS = ("slow-walk", "walk", "run", "happy", "stealth", "injured")
# The robot's hinges in MuJoCo's order, by the joints of our packs.
LEG = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
ARM = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll", "wrist_pitch", "wrist_yaw")
HINGES = (
    *(f"{side}_{joint}" for side in ("left", "right") for joint in LEG),
    *("waist_yaw", "waist_roll", "waist_pitch"),
    *(f"{side}_{joint}" for side in ("left", "right") for joint in ARM),
)
QPOS = 7 + len(HINGES)

OPEN = None  # an axis whose length the graph leaves open
Shape = tuple[int | None, ...]


@dataclass(frozen=True)
class Tensor:
    """A tensor of the graph; any of ``types`` and ``shapes`` is right."""

    name: str
    types: tuple[str, ...]
    shapes: tuple[Shape, ...]

    def allowed(self) -> str:
        """Types and shapes as text."""
        return f"{' or '.join(self.types)} {' or '.join(_text(shape) for shape in self.shapes)}"


INPUTS = (
    Tensor("context_mujoco_qpos", ("float32",), ((1, CONTEXT_FRAMES, QPOS),)),
    Tensor("target_vel", ("float32",), ((1,),)),
    Tensor("mode", ("int64",), ((1,),)),
    Tensor("movement_direction", ("float32",), ((1, 3),)),
    Tensor("facing_direction", ("float32",), ((1, 3),)),
    Tensor("height", ("float32",), ((1,),)),
    Tensor("random_seed", ("int64",), ((1,),)),
    Tensor("has_specific_target", ("int64",), ((1, 1),)),
    Tensor("specific_target_positions", ("float32",), ((1, 4, 3),)),
    Tensor("specific_target_headings", ("float32",), ((1, 4),)),
    Tensor("allowed_pred_num_tokens", ("int64",), ((1, COUNTS),)),
)
# NVIDIA's page says int64, and its program reads int32.
OUTPUTS = (
    Tensor("mujoco_qpos", ("float32",), ((1, MAX_FRAMES, QPOS), (1, OPEN, QPOS))),
    Tensor("num_pred_frames", ("int64", "int32"), ((), (1,))),
)


def _text(shape: Shape) -> str:
    return "[" + ", ".join("any" if size is OPEN else str(size) for size in shape) + "]"


def import_planner(file: Path, out: Path, like: Path, version: str) -> int:
    """Writes the pack folder and returns the number of weights."""
    parameters = read_planner(file)
    body = body_like(like)
    frames = run_planner(file, body)
    fresh = out.with_name(out.name + ".new")
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(parents=True)
    shutil.copyfile(file, fresh / "planner.onnx")
    sizes = {
        "frames_per_token": FRAMES_PER_TOKEN,
        "min_tokens": MIN_TOKENS,
        "max_tokens": MAX_TOKENS,
        "context_frames": CONTEXT_FRAMES,
        "parameters": parameters,
    }
    about = About(out.resolve().name, version, LICENCE, CREDITS, {"release": f"SONIC's planner, {file.name}"})
    write_manifest(fresh, FAMILY, about, sizes, digest_of(fresh, ["planner"]), body.skeleton, {})
    with (fresh / "pack.toml").open("a", encoding="utf-8") as manifest:
        manifest.write("\n".join(_family_lines()) + "\n")
    write_body(fresh, body, list(MODES), "troupe-train import-motionbricks-planner")
    shutil.rmtree(out / "bodies", ignore_errors=True)
    settle(fresh, out)
    print(f"{out}: plans of {', '.join(str(count) for count in frames)} frames; live characters alone")
    return parameters


def _family_lines() -> list[str]:
    return [
        "",
        "# What the graph's inputs mean: docs/decisions/official-networks.md.",
        "[sonic_planner]",
        f"body = {json.dumps(BODY)}",
        "# In the order of their numbers. They are the words of the pack, and its styles.",
        f"modes = {json.dumps(MODES)}",
        "# The mode of a command without a style.",
        f"default_mode = {json.dumps(DEFAULT_MODE)}",
        "# Modes that become the first one where the character stands.",
        f"walks = {json.dumps(WALKS)}",
        "# Whether the graph is given the last four frames of the path, beside a direction and a speed.",
        "specific_target = false",
    ]


def body_like(like: Path) -> Body:
    """The G1 of another pack: skeleton, hinges with their limits, and the pose that it stands in."""
    skeleton = Skeleton.of_manifest(read_manifest(like))
    if skeleton.robot is None:
        raise ReleaseError(f"{like} has no robot; allowed: a pack of the G1")
    found = [hinge["joint"] for hinge in skeleton.robot["hinges"]]
    for number, wanted in enumerate(HINGES):
        given = found[number] if number < len(found) else "missing"
        if given != wanted:
            raise ReleaseError(f"{like} is no pack of the G1: hinge {number} is {given}; allowed: {wanted}")
    if len(found) > len(HINGES):
        raise ReleaseError(f"{like} is no pack of the G1: it has {len(found)} hinges; allowed: {len(HINGES)}")
    return body_of(BODY, skeleton, robot_neutral(skeleton))


def read_planner(file: Path) -> int:
    """Checks the graph's inputs and outputs by name, type and shape; gives the number of its weights."""
    if not file.is_file():
        raise ReleaseError(f"{file} is no file; the release calls it planner_sonic.onnx")
    with file.open("rb") as opened:
        if opened.read(len(POINTER)) == POINTER:
            raise ReleaseError(f"{file} is a pointer of Git LFS: fetch the file itself with `git lfs pull`")
    try:
        model = onnx.load(file, load_external_data=False)
    except DecodeError as error:
        raise ReleaseError(f"{file} is no ONNX file: {error}") from error
    graph = model.graph
    outside = next((weights.name for weights in graph.initializer if uses_external_data(weights)), None)
    if outside is not None:
        raise ReleaseError(f"{file}: the weights {outside} lie in another file; allowed: one file with all weights")
    weights = {initializer.name for initializer in graph.initializer}
    given = {value.name: value for value in graph.input if value.name not in weights}
    problem = _first_problem("input", INPUTS, given) or _first_problem(
        "output", OUTPUTS, {value.name: value for value in graph.output}
    )
    extra = next((name for name in given if name not in {tensor.name for tensor in INPUTS}), None)
    if problem is None and extra is not None:
        problem = f"the input {extra} is unknown; allowed: {', '.join(tensor.name for tensor in INPUTS)}"
    if problem is not None:
        raise ReleaseError(f"{file}: {problem}")
    floats = (TensorProto.FLOAT, TensorProto.FLOAT16, TensorProto.DOUBLE)
    return sum(int(np.prod(weights.dims)) for weights in graph.initializer if weights.data_type in floats)


def _first_problem(kind: str, tensors: tuple[Tensor, ...], given: dict[str, ValueInfoProto]) -> str | None:
    for tensor in tensors:
        value = given.get(tensor.name)
        if value is None:
            return f"the {kind} {tensor.name} is missing; allowed: {tensor.allowed()}"
        found, shape = _described(value)
        if found not in tensor.types or shape not in tensor.shapes:
            said = "of any rank" if shape is None else _text(shape)
            return f"the {kind} {tensor.name} is {found} {said}; allowed: {tensor.allowed()}"
    return None


def _described(value: ValueInfoProto) -> tuple[str, Shape | None]:
    """A tensor's type and shape; no shape where the graph does not say it."""
    own = value.type.tensor_type
    if own.elem_type == TensorProto.UNDEFINED:
        return "no tensor", None
    name = str(onnx.helper.tensor_dtype_to_np_dtype(own.elem_type))
    if not own.HasField("shape"):
        return name, None
    return name, tuple(size.dim_value if size.HasField("dim_value") else OPEN for size in own.shape.dim)


def standing_inputs(body: Body, tokens: int) -> dict[str, torch.Tensor]:
    """Inputs of a robot that stands at the origin and shall walk ahead, in a plan of ``tokens`` tokens."""
    assert body.skeleton.robot is not None
    angles = [float(np.clip(0.0, h["lower_rad"], h["upper_rad"])) for h in body.skeleton.robot["hinges"]]
    frame = torch.tensor([0.0, 0.0, body.height_m, 1.0, 0.0, 0.0, 0.0, *angles])
    ahead = torch.tensor([[1.0, 0.0, 0.0]])
    return {
        "context_mujoco_qpos": frame.repeat(1, CONTEXT_FRAMES, 1),
        "target_vel": torch.tensor([1.0]),
        "mode": torch.tensor([MODES.index(DEFAULT_MODE)]),
        "movement_direction": ahead,
        "facing_direction": ahead,
        "height": torch.tensor([-1.0]),
        "random_seed": torch.tensor([1234]),
        "has_specific_target": torch.zeros(1, 1, dtype=torch.int64),
        "specific_target_positions": torch.zeros(1, 4, 3),
        "specific_target_headings": torch.zeros(1, 4),
        "allowed_pred_num_tokens": (torch.arange(COUNTS) == tokens - MIN_TOKENS).long()[None],
    }


def run_planner(file: Path, body: Body) -> list[int]:
    """Makes plans of several lengths. Gives their numbers of frames, and refuses a graph that answers with others."""
    session, made = Session(file), []
    for tokens in RUN_TOKENS:
        answer = session.run(standing_inputs(body, tokens))
        frames, wanted = int(answer["num_pred_frames"]), tokens * FRAMES_PER_TOKEN
        qpos = answer["mujoco_qpos"]
        if frames != wanted or qpos.shape[1] < wanted:
            raise ReleaseError(
                f"{file}: num_pred_frames is {frames}, and mujoco_qpos has {qpos.shape[1]}, for {tokens} tokens; "
                f"allowed: {wanted}"
            )
        if not bool(torch.isfinite(qpos[:, :wanted]).all()):
            raise ReleaseError(f"{file}: mujoco_qpos has numbers that are not finite for a robot that stands")
        made.append(frames)
    return made
