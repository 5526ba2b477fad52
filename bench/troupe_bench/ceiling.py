"""The most that a machine can give: the operations of a segment, and how many a second its cores multiply at best.

Prints JSON. Operations are counted on the graphs as they ship, at the shapes that a run of them has: two for each
multiplication of matrix products and convolutions; all else is not counted. The peak is that of large matrix products
through the same engine, one session a core, and is what no network can go beyond.
"""

import argparse
import json
import math
import tempfile
import threading
import time
import tomllib
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper

from troupe_bench.cli import ENGINES, STAGES
from troupe_bench.machine import cores
from troupe_bench.stages import open_session

PRODUCTS = ("MatMul", "Gemm", "Conv")
GEMM_SHAPES = ((1024, 1024, 1024), (1024, 256, 1024), (512, 2048, 2048))


def stage_inputs(session: onnxruntime.InferenceSession, tokens: int, per_token: int) -> dict[str, np.ndarray]:
    """Inputs of one row at ``tokens`` tokens, neutral but of the right shapes."""
    sizes = {"batch": 1, "tokens": tokens, f"{per_token}*tokens": per_token * tokens}
    inputs = {}
    for spec in session.get_inputs():
        shape = [sizes[axis] if isinstance(axis, str) else axis for axis in spec.shape]
        inputs[spec.name] = np.zeros(shape, np.int64 if spec.type == "tensor(int64)" else np.float32)
    if "num_tokens" in inputs:
        inputs["num_tokens"][:] = tokens
    if "allowed_counts" in inputs:
        inputs["allowed_counts"][:, -1] = 1.0
    return inputs


def count_operations(path: Path, tokens: int, per_token: int) -> float:
    """Floating-point operations of one row, from the shapes that every product has when the graph runs."""
    model = onnx.load(path)
    weights = {tensor.name: list(tensor.dims) for tensor in model.graph.initializer}
    products = [node for node in model.graph.node if node.op_type in PRODUCTS]
    names = list(dict.fromkeys(name for node in products for name in (*node.input[:2], node.output[0])))
    known = {output.name for output in model.graph.output} | {spec.name for spec in model.graph.input}
    model.graph.output.extend(onnx.ValueInfoProto(name=name) for name in names if name not in known)
    options = onnxruntime.SessionOptions()
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_DISABLE_ALL
    session = onnxruntime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])
    inputs = stage_inputs(session, tokens, per_token)
    wanted = [output.name for output in session.get_outputs()]
    values = dict(zip(wanted, session.run(wanted, inputs), strict=True)) | inputs
    shapes = weights | {name: list(value.shape) for name, value in values.items()}
    return float(sum(_operations(node, shapes) for node in products))


def _operations(node: onnx.NodeProto, shapes: dict[str, list[int]]) -> int:
    made = math.prod(shapes[node.output[0]])
    if node.op_type == "Conv":
        return 2 * made * math.prod(shapes[node.input[1]][1:])
    left = shapes[node.input[0]]
    turned = any(attribute.name == "transA" and attribute.i for attribute in node.attribute)
    return 2 * made * (left[-2] if turned else left[-1])


def gemm_peak(engine: str, workers: int, seconds: float) -> float:
    """Operations a second of large products with constant weights, the best shape of a few."""
    rng = np.random.default_rng(1)
    best = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for rows, inner, columns in GEMM_SHAPES:
            path = Path(folder) / f"{rows}-{inner}-{columns}.onnx"
            onnx.save(_product(rng, rows, inner, columns), path)
            sessions = [open_session(path, engine, 1, spin=False) for _ in range(workers)]
            x = rng.standard_normal((rows, inner), np.float32)
            for session in sessions:
                session.run(None, {"x": x})
            runs = _in_parallel(sessions, x, seconds)
            best = max(best, 8 * 2.0 * rows * inner * columns * runs / seconds)
    return best


def _product(rng: np.random.Generator, rows: int, inner: int, columns: int) -> onnx.ModelProto:
    """Eight products in parallel that share their input: what goes in and out counts for less."""
    nodes, weights, sums = [], [], []
    for index in range(8):
        weight = rng.standard_normal((inner, columns)).astype(np.float32) / math.sqrt(inner)
        weights.append(numpy_helper.from_array(weight, f"w{index}"))
        nodes.append(helper.make_node("MatMul", ["x", f"w{index}"], [f"y{index}"]))
        nodes.append(helper.make_node("ReduceMax", [f"y{index}"], [f"m{index}"], keepdims=1))
        sums.append(f"m{index}")
    nodes.append(helper.make_node("Sum", sums, ["out"]))
    graph = helper.make_graph(
        nodes,
        "product",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, ["rows", inner])],
        [helper.make_tensor_value_info("out", TensorProto.FLOAT, None)],
        weights,
    )
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)


def _in_parallel(sessions: list[onnxruntime.InferenceSession], x: np.ndarray, seconds: float) -> float:
    """Runs that all sessions together finish within ``seconds``."""
    done = [0.0] * len(sessions)
    gate = threading.Barrier(len(sessions))

    def loop(worker: int) -> None:
        gate.wait()
        started = time.perf_counter()
        runs = 0
        while (took := time.perf_counter() - started) < seconds:
            sessions[worker].run(None, {"x": x})
            runs += 1
        done[worker] = runs * seconds / took if took else 0.0

    threads = [threading.Thread(target=loop, args=(worker,)) for worker in range(len(sessions))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return sum(done)


def main() -> None:
    """Counts and measures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pack", type=Path, default=Path("models/human"))
    parser.add_argument("--engine", choices=ENGINES, default="cpu")
    parser.add_argument("--seconds", type=float, default=2.0, help="time for each shape")
    parser.add_argument("--repeats", type=int, default=5)
    args = parser.parse_args()
    manifest = tomllib.loads((args.pack / "pack.toml").read_text())
    tokens, per_token = manifest["max_tokens"], manifest["frames_per_token"]
    stages = {stage: count_operations(args.pack / f"{stage}.onnx", tokens, per_token) for stage in STAGES}
    workers = max(1, math.floor(cores()))
    peaks = sorted(gemm_peak(args.engine, workers, args.seconds) for _ in range(args.repeats))
    peak = peaks[len(peaks) // 2]
    segment, frames = sum(stages.values()), tokens * per_token
    result = {
        "frames": frames,
        "stage_mflop": {stage: value / 1e6 for stage, value in stages.items()},
        "segment_mflop": segment / 1e6,
        "peak_gflop_per_s": peak / 1e9,
        "workers": workers,
        "frames_per_s_at_peak": frames * peak / segment,
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
