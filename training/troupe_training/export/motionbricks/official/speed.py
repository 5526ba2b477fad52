"""Times the public MotionBricks code on plans of one length. It needs the environment of `reference`.

    python speed.py CHECKOUT/motionbricks RELEASE FRAMES THREADS SECONDS

``RELEASE`` has the weights, as `reference` writes them. Prints JSON: frames of a plan, milliseconds of each plan.
"""

import importlib
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import torch

SLOTS = 8  # keyframes: four of context, four targets


def main() -> None:
    """Plans until the time is over, after three plans that do not count."""
    code, release = (Path(text).resolve() for text in sys.argv[1:3])
    frames, threads, seconds = int(sys.argv[3]), int(sys.argv[4]), float(sys.argv[5])
    torch.set_num_threads(threads)
    sys.path.insert(0, str(code))
    os.chdir(code)  # configurations name files from here
    torch.manual_seed(1)
    build = importlib.import_module("reference").build  # the file beside this one
    models = {name: build(name) for name in ("pose", "root")}
    for name, model in models.items():
        path = next((release / f"out/motionbricks_{name}/version_1/checkpoints").glob("*.ckpt"))
        model.load_state_dict(torch.load(path, map_location="cpu", weights_only=False)["state_dict"])
        model.eval()
    models["pose"]._vqvae_model_loaded = True
    with torch.no_grad():
        print(json.dumps(timed(models, frames, seconds)))


def timed(models: dict[str, Any], frames: int, seconds: float) -> dict[str, Any]:
    """Milliseconds of every plan: four frames of context, four targets, the number of tokens given, one pass."""
    from motionbricks.helper.data_training_util import extract_feature_from_motion_rep
    from motionbricks.motion_backbone.inference.motion_inference import motion_inference

    runner = motion_inference(models, models["pose"].args, device="cpu")
    counts = runner._root_model.backbone_net
    tokens = torch.full([1, 1], frames // counts.get_num_frames_per_token())
    rep, mode = runner.local_motion_rep, runner.INTERNAL_POSE_FEATURE_MODE
    blank = torch.zeros(1, 1, len(rep.indices["all"]))
    features = len(extract_feature_from_motion_rep(blank, rep, mode, fetch_feat_idx=True)) - 1  # without the height
    given = torch.ones(1, SLOTS, dtype=torch.bool)
    root = torch.zeros(1, SLOTS, 5)
    root[..., 1], root[..., 3] = 0.75, 1.0
    root[0, SLOTS // 2 :, 2] = 1.0
    pairs = [root, given, torch.zeros(1, SLOTS, 4), given, torch.zeros(1, SLOTS, features), given]
    config = {"allow_pred_out_of_reach_num_tokens": False, "pose_token_sampling_use_argmax": True}
    took: list[float] = []
    plans, end = -3, None
    while end is None or time.perf_counter() < end:
        begun = time.perf_counter()
        made, _ = runner.predict(*(pair.clone() for pair in pairs), tokens.clone(), config=config)
        if plans >= 0:
            took.append(1000 * (time.perf_counter() - begun))
        plans += 1
        if plans == 0:
            end = time.perf_counter() + seconds
    return {"frames": frames, "made_frames": int(made.shape[1]), "plan_ms": took}


if __name__ == "__main__":
    main()
