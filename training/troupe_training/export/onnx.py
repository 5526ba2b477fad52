"""ONNX files of any network: out of PyTorch, with 16-bit weights, and open for use."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import torch
from onnx import TensorProto, helper, numpy_helper
from torch import Tensor, nn

SMALLEST_HALF = 256  # tensors with fewer numbers stay in 32 bits
Axes = dict[int, Any]  # of an input: the open ones by their place, each a `torch.export.Dim` or a multiple of one


def largest_of(differences: Tensor) -> float:
    """The largest absolute difference; infinite if one is not a number."""
    return float(differences.abs().nan_to_num(nan=float("inf")).max())


def graph_of(
    module: nn.Module, inputs: dict[str, Tensor], outputs: Sequence[str], axes: Sequence[Axes], opset: int
) -> onnx.ModelProto:
    """A module's graph, without the notes of PyTorch's exporter. ``axes`` are those of each input that stay open."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "graph.onnx"
        torch.onnx.export(
            module,
            tuple(inputs.values()),
            path,
            input_names=list(inputs),
            output_names=list(outputs),
            dynamic_shapes=list(axes),
            opset_version=opset,
            dynamo=True,
            external_data=False,
            verbose=False,
        )
        model = onnx.load(path)
    for node in model.graph.node:
        node.doc_string = ""
        del node.metadata_props[:]
    return model


def round_to_half(module: nn.Module) -> None:
    """Rounds every large weight to the nearest 16-bit float: what is checked is what is shipped."""
    with torch.no_grad():
        for tensor in [*module.parameters(), *module.buffers()]:
            if tensor.is_floating_point() and tensor.numel() >= SMALLEST_HALF:
                tensor.copy_(tensor.half().float())


def store_as_half(model: onnx.ModelProto, whole: Sequence[str] = ()) -> None:
    """Replaces large 32-bit initializers by 16-bit ones followed by a Cast, save those that ``whole`` names."""
    casts = []
    for tensor in model.graph.initializer:
        name, small = tensor.name, np.prod(tensor.dims) < SMALLEST_HALF
        if tensor.data_type != TensorProto.FLOAT or small or name in whole:
            continue
        half = numpy_helper.from_array(numpy_helper.to_array(tensor).astype(np.float16), name + ".half")
        tensor.CopyFrom(half)
        casts.append(helper.make_node("Cast", [name + ".half"], [name], to=TensorProto.FLOAT))
    nodes = casts + list(model.graph.node)
    del model.graph.node[:]
    model.graph.node.extend(nodes)
    del model.graph.value_info[:]


class Session:
    """An ONNX file at work in ONNX Runtime; ``threads`` 0: as many as there are cores."""

    def __init__(self, path: Path, threads: int = 0):
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        self.session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
        self.outputs = [output.name for output in self.session.get_outputs()]

    def run(self, inputs: dict[str, Tensor]) -> dict[str, Tensor]:
        """Tensors by name in, tensors by name out."""
        arrays = self.session.run(None, {name: value.contiguous().numpy() for name, value in inputs.items()})
        return {name: torch.from_numpy(array) for name, array in zip(self.outputs, arrays, strict=True)}
