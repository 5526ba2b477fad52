"""A small graph with the tensors of NVIDIA's planner file, whose answer depends on each of them. Its poses are random.

The four context frames come back as they are. From the last of them on, the robot goes in ``movement_direction`` at
``target_vel``, or to the last of the given targets. Within 20 frames it turns to ``facing_direction``, and takes the pose
of its mode.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

MODES, FRAMES, QPOS, COUNTS, LEAST_TOKENS = 27, 64, 36, 11, 6
INPUTS: tuple[tuple[str, int, Sequence[int]], ...] = (
    ("context_mujoco_qpos", TensorProto.FLOAT, (1, 4, QPOS)),
    ("target_vel", TensorProto.FLOAT, (1,)),
    ("mode", TensorProto.INT64, (1,)),
    ("movement_direction", TensorProto.FLOAT, (1, 3)),
    ("facing_direction", TensorProto.FLOAT, (1, 3)),
    ("height", TensorProto.FLOAT, (1,)),
    ("random_seed", TensorProto.INT64, (1,)),
    ("has_specific_target", TensorProto.INT64, (1, 1)),
    ("specific_target_positions", TensorProto.FLOAT, (1, 4, 3)),
    ("specific_target_headings", TensorProto.FLOAT, (1, 4)),
    ("allowed_pred_num_tokens", TensorProto.INT64, (1, COUNTS)),
)
OUTPUTS: tuple[tuple[str, int, Sequence[int]], ...] = (
    ("mujoco_qpos", TensorProto.FLOAT, (1, FRAMES, QPOS)),
    ("num_pred_frames", TensorProto.INT64, ()),
)


class Nodes:
    """Adds nodes to a graph: ``nodes("Add", a, b)`` is the name of the sum. Arrays become weights."""

    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.weights: list[onnx.TensorProto] = []

    def __call__(self, op: str, *inputs: Any, out: str | None = None, **attributes: Any) -> str:
        out = out or f"n{len(self.nodes)}"
        names = [given if isinstance(given, str) else self.weight(given) for given in inputs]
        self.nodes.append(helper.make_node(op, names, [out], **attributes))
        return out

    def weight(self, value: Any) -> str:
        array = np.asarray(value)
        array = array.astype(np.float32) if array.dtype == np.float64 else array
        name = f"w{len(self.weights)}"
        self.weights.append(numpy_helper.from_array(array, name))
        return name

    def columns(self, name: str, start: int, end: int) -> str:
        return self("Slice", name, [start], [end], [-1])


def planner(seed: int = 1) -> onnx.ModelProto:
    nodes = Nodes()
    poses = np.random.default_rng(seed).uniform(0.02, 0.2, (MODES, QPOS - 7))
    column = np.arange(FRAMES, dtype=np.float64)[:, None]
    after = np.maximum(column - 3, 0)
    faded = np.minimum(after / 20, 1)

    first = nodes("ArgMax", "allowed_pred_num_tokens", axis=1, keepdims=0)
    frames = nodes("Mul", nodes("Add", first, [LEAST_TOKENS]), [4])
    nodes("Squeeze", frames, out="num_pred_frames")

    now = nodes("Gather", "context_mujoco_qpos", np.int64(3), axis=1)
    place = nodes.columns(now, 0, 3)
    flag = nodes("Cast", "has_specific_target", to=TensorProto.BOOL)
    own_speed = nodes("Mul", nodes("Cast", "mode", to=TensorProto.FLOAT), 0.05)
    speed = nodes("Where", nodes("Greater", "target_vel", 0.0), "target_vel", own_speed)
    going = nodes("Add", place, nodes("Mul", after / 30, nodes("Mul", "movement_direction", speed)))
    last = nodes("Gather", "specific_target_positions", np.int64(3), axis=1)
    share = nodes("Min", nodes("Div", after, nodes("Sub", nodes("Cast", frames, to=TensorProto.FLOAT), 4.0)), 1.0)
    aimed = nodes("Add", place, nodes("Mul", share, nodes("Sub", last, place)))
    ground = nodes.columns(nodes("Where", flag, aimed, going), 0, 2)
    height = nodes("Where", nodes("GreaterOrEqual", "height", 0.0), "height", nodes.columns(place, 2, 3))
    height = nodes("Expand", height, [FRAMES, 1])

    rotation = nodes("Mul", nodes.columns(now, 3, 7), 1.0 - faded)
    turned = nodes("Mul", facing(nodes, flag), faded)
    rotation = nodes("Add", rotation, turned)
    rotation = nodes("Div", rotation, nodes("ReduceL2", rotation, axes=[1]))

    jitter = nodes("Cast", nodes("Mod", "random_seed", [100]), to=TensorProto.FLOAT)
    pose = nodes("Add", nodes("Gather", poses, "mode", axis=0), nodes("Mul", jitter, 0.0002))
    angles = nodes("Add", nodes("Mul", nodes.columns(now, 7, QPOS), 1.0 - faded), nodes("Mul", pose, faded))

    made = nodes("Concat", ground, height, rotation, angles, axis=1)
    made = nodes("Slice", nodes("Unsqueeze", made, [0]), [4], [FRAMES], [1])
    nodes("Concat", "context_mujoco_qpos", made, axis=1, out="mujoco_qpos")

    values = ([helper.make_tensor_value_info(*tensor) for tensor in tensors] for tensors in (INPUTS, OUTPUTS))
    graph = helper.make_graph(nodes.nodes, "planner", *values, initializer=nodes.weights)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.checker.check_model(model, full_check=True)
    return model


def facing(nodes: Nodes, flag: str) -> str:
    """The rotation (w, x, y, z) towards ``facing_direction``, or of the last given heading: ``[1, 4]``."""
    flat = nodes.columns("facing_direction", 0, 2)
    flat = nodes("Div", flat, nodes("ReduceL2", flat, axes=[1]))
    heading = nodes.columns("specific_target_headings", 3, 4)
    given = nodes("Concat", nodes("Cos", heading), nodes("Sin", heading), axis=1)
    flat = nodes("Where", flag, given, flat)
    cos, sin = nodes.columns(flat, 0, 1), nodes.columns(flat, 1, 2)
    w = nodes("Sqrt", nodes("Max", nodes("Mul", nodes("Add", 1.0, cos), 0.5), 0.0))
    z = nodes("Sqrt", nodes("Max", nodes("Mul", nodes("Sub", 1.0, cos), 0.5), 0.0))
    z = nodes("Mul", z, nodes("Where", nodes("Less", sin, 0.0), -1.0, 1.0))
    return nodes("Concat", w, [[0.0, 0.0]], z, axis=1)


def write_planner(folder: Path) -> Path:
    path = folder / "planner_sonic.onnx"
    onnx.save(planner(), path)
    return path
