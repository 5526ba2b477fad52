"""``evaluator.onnx``: plain operators of opset 17 only, so that small runtimes can run it."""

from pathlib import Path

import onnx
import torch

from troupe_training.data.conventions import MAX_FRAMES, MIN_FRAMES
from troupe_training.data.store import ClipStore
from troupe_training.export.onnx import Session, graph_of, largest_of
from troupe_training.models.evaluator import INPUTS, Evaluator, inputs_of

OPSET = 17
TOLERANCE = 1e-3
CHECKED = ((1, 12), (3, 20), (5, 33), (2, 64))  # batch size, frames
# Operators of the exported graph, all the same in opset 17 and 18: PyTorch writes the latter.
OPERATORS = {
    "Add", "Concat", "Constant", "Div", "Gather", "Gemm", "MatMul", "Mul", "ReduceSum", "Reshape", "Shape", "Sigmoid",
    "Slice", "Softmax", "Sqrt", "Squeeze", "Sub", "Transpose", "Unsqueeze",
}  # fmt: skip


def export_evaluator(model: Evaluator, store: ClipStore, out: Path) -> float:
    """Writes ``out`` and compares it with PyTorch at several sizes; too large a difference ends the export."""
    examples = []
    for size, frames in CHECKED:
        longest = next((length for length in store.lengths() if length >= frames), None)
        if longest is None:
            continue
        starts = store.sample(size, longest, torch.Generator().manual_seed(frames))
        examples.append(inputs_of(store.segments(starts, frames)))
    batch = torch.export.Dim("batch", min=1, max=4096)
    time = torch.export.Dim("frames", min=MIN_FRAMES, max=MAX_FRAMES)
    graph = graph_of(model, examples[1], ["latent"], [{0: batch, 1: time}] * len(INPUTS), OPSET + 1)
    others = {node.op_type for node in graph.graph.node} - OPERATORS
    if others:
        raise SystemExit(f"the evaluator's graph has operators that it should not have: {sorted(others)}")
    graph.doc_string = "Troupe motion evaluator"
    graph.opset_import[0].version = OPSET
    onnx.checker.check_model(graph, full_check=True)
    out.parent.mkdir(parents=True, exist_ok=True)
    onnx.save(graph, out)
    session = Session(out)
    worst = 0.0
    for example in examples:
        with torch.no_grad():
            worst = max(worst, largest_of(session.run(example)["latent"] - model(**example)))
    if worst > TOLERANCE:
        raise SystemExit(f"{out} differs from PyTorch by {worst:.1e}, at most {TOLERANCE} is allowed")
    return worst
