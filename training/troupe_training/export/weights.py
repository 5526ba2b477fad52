"""The weights of a pack's ONNX file, by the names that PyTorch has for them."""

from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import numpy_helper
from torch import Tensor

FLOATS = (onnx.TensorProto.FLOAT, onnx.TensorProto.FLOAT16)


def weights_of(path: Path) -> dict[str, Tensor]:
    """The graph's numbers by the names that PyTorch has for them.

    Biases and constants keep their names in a graph; the matrix of a linear layer is what is multiplied before its bias is
    added.
    """
    graph = onnx.load(path).graph
    numbers = {
        i.name.removesuffix(".half"): numpy_helper.to_array(i).astype(np.float32)
        for i in graph.initializer
        if i.data_type in FLOATS
    }
    producers = {output: node for node in graph.node for output in node.output}

    def number(name: str) -> str:
        """The initializer behind a name, through the Cast of 16-bit weights."""
        node = producers.get(name)
        return (node.input[0] if node and node.op_type == "Cast" else name).removesuffix(".half")

    found = dict(numbers)
    for node in graph.node:
        names = [number(name) for name in node.input]
        if node.op_type == "Add" and any(name.endswith(".bias") for name in names):
            bias = next(name for name in names if name.endswith(".bias"))
            other = node.input[1 - names.index(bias)]
            product = producers.get(other)
            if product is not None and product.op_type == "MatMul":
                found.setdefault(bias.removesuffix("bias") + "weight", numbers[number(product.input[1])].T)
        elif node.op_type == "Gemm" and len(names) == 3:
            turned = next((a.i for a in node.attribute if a.name == "transB"), 0)
            matrix = numbers[names[1]] if turned else numbers[names[1]].T
            found.setdefault(names[2].removesuffix("bias") + "weight", matrix)
    return {name: torch.from_numpy(np.array(value)) for name, value in found.items()}
