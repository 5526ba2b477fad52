"""Times the public MotionBricks code on plans of one length. It needs the environment of `reference`.

    python speed.py CHECKOUT/motionbricks RELEASE --frames 40 --threads 2 --seconds 8

``RELEASE`` has the weights, as `reference` writes them. Prints ``ready`` when it is warm, and begins when a line comes, so that
several of these begin together. Then it prints JSON: plans a call, frames of an answer, milliseconds of each call.

The code as it was published takes one request a call, in 32 bits. ``--batch`` and ``--bf16`` change it as little as each needs.
"""

import argparse
import importlib
import json
import os
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import torch

SLOTS = 8  # keyframes: four of context, four targets
WARM_CALLS = 3


def main() -> None:
    """Plans until the time is over, after calls that do not count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("code", type=Path)
    parser.add_argument("release", type=Path)
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--batch", type=int, help="plans a call; left out, the code is as it was published")
    parser.add_argument("--bf16", action="store_true", help="under autocast; results of networks become 32 bits again")
    args = parser.parse_args()
    code, release = args.code.resolve(), args.release.resolve()
    torch.set_num_threads(args.threads)
    sys.path.insert(0, str(code))
    os.chdir(code)  # configurations name files from here
    models = load(release)
    runner = runner_of(models, args.batch is not None, args.bf16)
    precision = torch.autocast("cpu", torch.bfloat16) if args.bf16 else nullcontext()
    with torch.no_grad(), precision:
        print(json.dumps(timed(runner, args.batch or 1, args.frames, args.seconds)))


def load(release: Path) -> dict[str, Any]:
    """The models with the release's weights."""
    build = importlib.import_module("reference").build  # the file beside this one
    models = {name: build(name) for name in ("pose", "root")}
    for name, model in models.items():
        path = next((release / f"out/motionbricks_{name}/version_1/checkpoints").glob("*.ckpt"))
        model.load_state_dict(torch.load(path, map_location="cpu", weights_only=False)["state_dict"])
        model.eval()
    models["pose"]._vqvae_model_loaded = True
    return models


def runner_of(models: dict[str, Any], batched: bool, bf16: bool) -> Any:
    """The public code's own runner, or one with what batches and bf16 need."""
    from motionbricks.motion_backbone.inference.motion_inference import motion_inference

    if bf16:
        # PyTorch's fast path for transformers and the code between the networks are for 32 bits.
        torch.backends.mha.set_fastpath_enabled(False)
        networks = (models["root"].backbone_net, models["pose"].backbone_net)
        for network in (*networks, models["pose"].supporting_nets["pose_net"].decoder):
            network.register_forward_hook(lambda _, __, made: in_32_bits(made))
    if not batched:
        return motion_inference(models, models["pose"].args, device="cpu")

    class Batched(motion_inference):  # type: ignore[misc]
        """Its tokens are masked for one plan only."""

        def _sample_tokens_with_highest_prob(
            self, tokens: torch.Tensor, probable: torch.Tensor, counts: torch.Tensor, step: int, steps: int
        ) -> torch.Tensor:
            mask = super()._sample_tokens_with_highest_prob
            rows = zip(tokens.split(1), probable.split(1), counts.split(1), strict=True)
            return torch.cat([mask(*row, step, steps) for row in rows])

    # It reads the counts of a batch as if they were a row.
    models["root"].backbone_net.register_forward_hook(
        lambda _, __, made: made | {"pred_num_tokens": made["pred_num_tokens"].view(-1, 1)}
    )
    return Batched(models, models["pose"].args, device="cpu")


def in_32_bits(made: Any) -> Any:
    """What a network answers, under autocast."""
    if isinstance(made, torch.Tensor):
        return made.float()
    return {name: value.float() if value.is_floating_point() else value for name, value in made.items()}


def timed(runner: Any, batch: int, frames: int, seconds: float) -> dict[str, Any]:
    """Milliseconds of every call: four frames of context, four targets, the number of tokens given, one pass.

    Raises RuntimeError if an answer has too few frames, or numbers that are not finite: it would be fast.
    """
    from motionbricks.helper.data_training_util import extract_feature_from_motion_rep

    counts = runner._root_model.backbone_net
    tokens = torch.full([batch, 1], frames // counts.get_num_frames_per_token())
    rep, mode = runner.local_motion_rep, runner.INTERNAL_POSE_FEATURE_MODE
    blank = torch.zeros(1, 1, len(rep.indices["all"]))
    features = len(extract_feature_from_motion_rep(blank, rep, mode, fetch_feat_idx=True)) - 1  # without the height
    given = torch.ones(batch, SLOTS, dtype=torch.bool)
    root = torch.zeros(batch, SLOTS, 5)
    root[..., 1], root[..., 3] = 0.75, 1.0
    root[:, SLOTS // 2 :, 2] = 1.0
    pairs = [root, given, torch.zeros(batch, SLOTS, 4), given, torch.zeros(batch, SLOTS, features), given]
    config = {"allow_pred_out_of_reach_num_tokens": False, "pose_token_sampling_use_argmax": True}

    def call() -> torch.Tensor:
        made, _ = runner.predict(*(pair.clone() for pair in pairs), tokens.clone(), config=config)
        return made

    for _ in range(WARM_CALLS):
        call()
    print("ready", flush=True)
    sys.stdin.readline()
    took: list[float] = []
    end = time.perf_counter() + seconds
    while not took or time.perf_counter() < end:
        begun = time.perf_counter()
        made = call()
        took.append(1000 * (time.perf_counter() - begun))
    if made.shape[0] != batch or made.shape[1] < frames or not made[:, :frames].isfinite().all():
        raise RuntimeError(
            f"an answer of {tuple(made.shape)} numbers that are not all finite; asked: {batch}, {frames}"
        )
    return {"batch": batch, "made_frames": int(made.shape[1]), "call_ms": took}


if __name__ == "__main__":
    main()
