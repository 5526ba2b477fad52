"""Where the networks' own time goes: the operators of each stage, as the engine runs them.

Prints JSON. One thread, a batch of full segments with neutral inputs; ONNX Runtime's profiler for f32, OpenVINO's counters
for bf16. What the engine has fused counts for what it names it.
"""

import argparse
import json
import tempfile
import tomllib
from collections import defaultdict
from pathlib import Path

import numpy as np
import onnxruntime

from troupe_bench.ceiling import count_operations, stage_inputs
from troupe_bench.cli import ENGINES, STAGES

KINDS = {
    "products": ("MatMul", "Gemm", "Conv", "FullyConnected", "Convolution"),
    "norms": ("LayerNormalization", "SkipLayerNormalization", "MVN", "RMS", "Softmax", "GroupNormalization"),
    "moves": (
        "Transpose",
        "Reshape",
        "Concat",
        "Reorder",
        "Split",
        "VariadicSplit",
        "Slice",
        "StridedSlice",
        "Gather",
        "GatherND",
        "Expand",
        "Tile",
        "Pad",
        "Broadcast",
        "Unsqueeze",
        "Squeeze",
        "Cast",
        "Convert",
        "ScatterUpdate",
    ),
}
"""Kinds of operators; all others work element by element (OpenVINO's `Subgraph` is many of them in one)."""


def kind_of(operator: str) -> str:
    """The kind of an operator, by the name that its engine gives it."""
    plain = operator.removeprefix("Fused")
    return next((kind for kind, names in KINDS.items() if plain in names), "elementwise")


def batch_of(inputs: dict[str, np.ndarray], batch: int) -> dict[str, np.ndarray]:
    """Inputs of one row, ``batch`` times."""
    return {name: np.repeat(value, batch, axis=0) for name, value in inputs.items()}


def profile_cpu(path: Path, inputs: dict[str, np.ndarray], runs: int) -> dict[str, float]:
    """Milliseconds of a run by operator in ONNX Runtime."""
    with tempfile.TemporaryDirectory() as folder:
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.enable_profiling, options.profile_file_prefix = True, str(Path(folder) / "run")
        session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        for _ in range(2 * runs):
            session.run(None, inputs)
        events = json.loads(Path(session.end_profiling()).read_text())
    took: dict[str, float] = defaultdict(float)
    nodes = [event for event in events if event.get("cat") == "Node" and "op_name" in event.get("args", {})]
    for event in nodes[len(nodes) // 2 :]:  # the first half warms up
        took[event["args"]["op_name"]] += event["dur"] / 1000 / runs
    return took


def profile_openvino(path: Path, inputs: dict[str, np.ndarray], runs: int) -> dict[str, float]:
    """Milliseconds of a run by operator in OpenVINO, with matrix products in 16 bits."""
    import openvino

    settings = {"INFERENCE_PRECISION_HINT": "bf16", "INFERENCE_NUM_THREADS": 1, "PERF_COUNT": True}
    compiled = openvino.Core().compile_model(str(path), "CPU", settings)
    request = compiled.create_infer_request()
    took: dict[str, float] = defaultdict(float)
    for run in range(2 * runs):
        request.infer(inputs)
        for node in request.profiling_info if run >= runs else ():
            took[node.node_type] += node.real_time.total_seconds() * 1000 / runs
    return took


def main() -> None:
    """Measures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pack", type=Path, default=Path("models/human"))
    parser.add_argument("--engine", choices=ENGINES, default="cpu")
    parser.add_argument("--batch", type=int, default=16)
    parser.add_argument("--runs", type=int, default=30)
    args = parser.parse_args()
    manifest = tomllib.loads((args.pack / "pack.toml").read_text())
    tokens, per_token = manifest["max_tokens"], manifest["frames_per_token"]
    profile = profile_cpu if args.engine == "cpu" else profile_openvino
    stages = {}
    for stage in STAGES:
        path = args.pack / f"{stage}.onnx"
        session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
        inputs = batch_of(stage_inputs(session, tokens, per_token), args.batch)
        took = profile(path, inputs, args.runs)
        kinds: dict[str, float] = defaultdict(float)
        for operator, ms in took.items():
            kinds[kind_of(operator)] += ms
        mflop = args.batch * count_operations(path, tokens, per_token) / 1e6
        stages[stage] = {"ms": kinds, "operators_ms": took, "mflop": mflop}
    print(json.dumps({"batch": args.batch, "frames": tokens * per_token, "stages": stages}))


if __name__ == "__main__":
    main()
