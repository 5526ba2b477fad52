"""Writes tiny.onnx, an evaluator of a skeleton of two joints for the tests.

    python eval/src/evaluator/tiny.py

Its latent holds three means over the frames: root z, the second joint's z, and twice the first joint's first rotation entry.
As in the packs' files the weights are stored in 16 bits behind a Cast, and batch and frames are dynamic.
"""

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

weights = np.zeros((5 + 2 * 3 + 2 * 6, 3), np.float16)
weights[2, 0] = 1  # root z
weights[5 + 5, 1] = 1  # the second joint's z
weights[5 + 6, 2] = 2  # the first joint's first rotation entry

nodes = [
    helper.make_node("Cast", ["weights.half"], ["weights"], to=TensorProto.FLOAT),
    helper.make_node("Reshape", ["positions", "flat"], ["positions.flat"]),
    helper.make_node("Reshape", ["six_d", "flat"], ["six_d.flat"]),
    helper.make_node("Concat", ["root", "positions.flat", "six_d.flat"], ["features"], axis=-1),
    helper.make_node("MatMul", ["features", "weights"], ["latents"]),
    helper.make_node("ReduceMean", ["latents"], ["latent"], axes=[1], keepdims=0),
]
inputs = [("root", [5]), ("positions", [2, 3]), ("six_d", [2, 6])]
graph = helper.make_graph(
    nodes,
    "tiny",
    [helper.make_tensor_value_info(name, TensorProto.FLOAT, ["batch", "frames", *shape]) for name, shape in inputs],
    [helper.make_tensor_value_info("latent", TensorProto.FLOAT, ["batch", 3])],
    [numpy_helper.from_array(weights, "weights.half"), numpy_helper.from_array(np.array([0, 0, -1], np.int64), "flat")],
)
model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
onnx.checker.check_model(model)
onnx.save(model, Path(__file__).with_name("tiny.onnx"))
