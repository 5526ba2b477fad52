"""The three networks of a pack in Python: what a Troupe server does between a request's arrays and an answer's.

numpy and ONNX Runtime only, with as little Python as a batch can do with: a row costs a handful of copies.
"""

import functools
import itertools
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import onnxruntime

from troupe_bench.body import CONTEXT_FRAMES, Task, read_task, write_answer
from troupe_bench.cli import STAGES

SLOTS = 8  # the context frames and the last four frames of the segment
CALL_ROWS = (1, 4, 8)
BUCKETS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
OPENVINO = '{"CPU":{"INFERENCE_PRECISION_HINT":"bf16","INFERENCE_NUM_THREADS":"%d","ENABLE_CPU_PINNING":"NO"}}'


@dataclass
class Solved:
    """One character's answer: its tokens ``[n, heads]`` and frames."""

    tokens: np.ndarray
    rotations: np.ndarray
    root: np.ndarray
    contacts: np.ndarray

    def encode(self) -> bytes:
        """The answer's body."""
        return write_answer(len(self.tokens), self.rotations, self.root, self.contacts)


def open_session(
    path: Path, engine: str, threads: int, spin: bool, axes: dict[str, int] | None = None
) -> onnxruntime.InferenceSession:
    """One stage on ``engine`` with ``threads`` threads, and ``axes`` that are open in its graph fixed."""
    options = onnxruntime.SessionOptions()
    for name, size in (axes or {}).items():
        options.add_free_dimension_override_by_name(name, size)
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.enable_mem_pattern = False  # shapes change from batch to batch
    options.add_session_config_entry("session.intra_op.allow_spinning", "1" if spin else "0")
    providers: list[str | tuple[str, dict[str, str]]] = ["CPUExecutionProvider"]
    if engine == "openvino-bf16":
        if "OpenVINOExecutionProvider" not in onnxruntime.get_available_providers():
            raise RuntimeError("this ONNX Runtime has no OpenVINO")
        settings = {"device_type": "CPU", "load_config": OPENVINO % threads}
        providers.insert(0, ("OpenVINOExecutionProvider", settings))
    return onnxruntime.InferenceSession(str(path), options, providers=providers)


class Network:
    """One stage: a session for all shapes and, with OpenVINO, one for each size of a call of the longest segments.

    The latter are the server's (`server/src/engine/onnx/network.rs`), which has them for other lengths too.
    """

    def __init__(self, path: Path, engine: str, threads: int, spin: bool, longest: dict[str, int]):
        self.open = open_session(path, engine, threads, spin)
        sizes = () if engine == "cpu" else CALL_ROWS
        self.fixed = {rows: open_session(path, engine, threads, spin, {"batch": rows} | longest) for rows in sizes}

    def run(self, names: list[str], inputs: dict[str, np.ndarray], longest: bool) -> list[np.ndarray]:
        """The outputs called ``names``. ``longest`` says that the inputs are of the longest segments."""
        if not (self.fixed and longest):
            return self.open.run(names, inputs)
        rows, done, parts = len(next(iter(inputs.values()))), 0, []
        while done < rows:
            size = max(size for size in CALL_ROWS if size <= rows - done)
            call = {name: values[done : done + size] for name, values in inputs.items()}
            parts.append(self.fixed[size].run(names, call))
            done += size
        return parts[0] if len(parts) == 1 else [np.concatenate(part) for part in zip(*parts, strict=True)]


@functools.cache
def slots_of(spare: int, targets: int) -> tuple[np.ndarray, np.ndarray]:
    """Slots of the root stage that hold keyframes, and the number of each one's keyframe.

    Slots count from the end of the last token, ``spare`` frames of which lie behind the last target.
    """
    last = SLOTS - spare
    slots = np.r_[:CONTEXT_FRAMES, last - targets : last]
    keys = np.arange(CONTEXT_FRAMES + targets)
    fits = (keys < CONTEXT_FRAMES) | (slots >= CONTEXT_FRAMES)
    return slots[fits], keys[fits]


class Stages:
    """Root, pose and decoder of one pack. Calls from several threads are fine: nothing is kept between them."""

    def __init__(self, pack: Path, engine: str, threads: int, group: bool = True, spin: bool = True):
        """``group`` runs the rows of each length for themselves behind the root stage; else all are padded to the longest."""
        manifest = tomllib.loads((pack / "pack.toml").read_text())
        self.min_tokens, self.max_tokens = manifest["min_tokens"], manifest["max_tokens"]
        self.heads, self.codes = manifest["heads"], manifest["codes"]
        self.per_token = manifest["frames_per_token"]
        self.pose_width = 9 * len(manifest["skeleton"]["joints"])
        self.counts = self.max_tokens - self.min_tokens + 1
        self.choices: int = manifest.get("root_choices", 0)
        self.group = group
        # OpenVINO plans again for a batch size it has not met; ONNX Runtime's own kernels do not
        # mind.
        self.pad_batch = engine != "cpu"
        longest = {"tokens": self.max_tokens, "4*tokens": self.max_tokens * self.per_token}
        self.root, self.pose, self.decoder = (
            Network(pack / f"{name}.onnx", engine, threads, spin, {} if name == "root" else longest) for name in STAGES
        )

    def warm_up(self, bodies: Sequence[bytes], largest: int) -> None:
        """Runs the batch sizes up to ``largest``, because the first run of a shape is slow."""
        for size in (size for size in BUCKETS if size <= largest):
            for start in range(0, len(bodies), max(1, len(bodies) // 4)):
                self.run(list(itertools.islice(itertools.cycle(bodies), start, start + size)))

    def run(self, bodies: Sequence[bytes]) -> list[bytes]:
        """Answers a batch of requests."""
        return [solved.encode() for solved in self.solve([read_task(b, self.pose_width) for b in bodies])]

    def solve(self, tasks: Sequence[Task]) -> list[Solved]:
        """Solves a batch of tasks."""
        counts, roots = self._run_root(tasks)
        solved: dict[int, Solved] = {}
        order = range(len(tasks))
        if self.group:
            lengths = sorted(set(counts.tolist()))
            groups = [[row for row in order if counts[row] == length] for length in lengths]
        else:
            groups = [list(order)]
        for rows in groups:
            answers = self._run_tokens([tasks[row] for row in rows], counts[rows], roots[rows])
            solved |= zip(rows, answers, strict=True)
        return [solved[row] for row in order]

    def _rows(self, wanted: int, longest: bool) -> int:
        """Rows of a batch, padding included."""
        if not self.pad_batch:
            return wanted
        if longest:
            whole, rest = divmod(wanted, CALL_ROWS[-1])
            return whole * CALL_ROWS[-1] + next(rows for rows in (0, 1, 2, 4, 5, 8) if rows >= rest)
        return next((bucket for bucket in BUCKETS if bucket >= wanted), wanted)

    def _run_root(self, tasks: Sequence[Task]) -> tuple[np.ndarray, np.ndarray]:
        """Token counts ``[B]`` and trajectories ``[B, 64, 5]``."""
        rows = self._rows(len(tasks), True)
        local = np.zeros((rows, SLOTS, 4), np.float32)
        root = np.zeros((rows, SLOTS, 5), np.float32)
        pose = np.zeros((rows, SLOTS, self.pose_width), np.float32)
        given = np.zeros((3, rows, SLOTS), np.float32)
        allowed = np.ones((rows, self.counts), np.float32)
        bits = np.arange(self.counts)
        for row, task in enumerate(tasks):
            # A frame count may leave frames of the last token behind the last target.
            slots, keys = slots_of(-task.frames % self.per_token if task.frames else 0, task.targets)
            local[row, slots] = task.local_root[keys]
            root[row, slots] = task.global_root[keys]
            pose[row, slots] = task.pose[keys]
            given[:, row, slots] = task.given[keys].T
            allowed[row] = (task.allowed >> bits) & 1
        inputs = {
            "key_local_root": local,
            "key_global_root": root,
            "key_pose": pose,
            "has_local_root": given[0],
            "has_global_root": given[1],
            "has_pose": given[2],
            "allowed_counts": allowed,
            "count_noise": np.zeros((rows, self.counts), np.float32),
        }
        if self.choices:
            inputs["root_noise"] = np.zeros((rows, self.choices), np.float32)
        counts, trajectory = self.root.run(["num_tokens", "global_root"], inputs, True)
        return counts[: len(tasks)], trajectory[: len(tasks)]

    def _run_tokens(self, tasks: Sequence[Task], counts: np.ndarray, roots: np.ndarray) -> list[Solved]:
        """Pose stage and decoder for rows padded to their longest."""
        length = int(counts.max())
        longest = length == self.max_tokens
        rows = self._rows(len(tasks), longest)
        span = length * self.per_token
        tokens = np.zeros((rows, length, self.heads), np.int64)
        num_tokens = np.full(rows, self.min_tokens, np.int64)
        num_tokens[: len(tasks)] = counts
        trajectory = np.zeros((rows, span, 5), np.float32)
        trajectory[..., 3] = 1.0
        frame_pose = np.zeros((rows, span, self.pose_width), np.float32)
        frame_mask = np.zeros((rows, span), np.float32)
        frames = [task.frames or int(count) * self.per_token for task, count in zip(tasks, counts, strict=True)]
        for row, (task, count, end) in enumerate(zip(tasks, counts, frames, strict=True)):
            tokens[row, :count] = self.codes  # masked
            trajectory[row, : count * self.per_token] = roots[row, : count * self.per_token]
            at = np.r_[:CONTEXT_FRAMES, end - task.targets : end]
            frame_mask[row, at] = task.given[:, 2]
            frame_pose[row, at] = task.pose
        inputs = {
            "tokens": tokens,
            "num_tokens": num_tokens,
            "global_root": trajectory,
            "frame_pose": frame_pose,
            "frame_mask": frame_mask,
        }
        chosen = self.pose.run(["logits"], inputs, longest)[0].argmax(-1)
        inputs["tokens"] = chosen
        rotations, refined, contacts = self.decoder.run(["rotations", "refined_root", "contacts"], inputs, longest)
        return [
            Solved(chosen[row, :count], rotations[row, :end], refined[row, :end], contacts[row, :end])
            for row, (count, end) in enumerate(zip(counts, frames, strict=True))
        ]
