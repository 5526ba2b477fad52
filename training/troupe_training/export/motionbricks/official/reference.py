"""Runs the public MotionBricks code on requests and notes what each of its stages answers. It needs an environment of its own.

    python reference.py CHECKOUT/motionbricks REQUESTS.npz FOLDER

Without the weights, which Git LFS keeps, it draws random ones. ``FOLDER/release`` is then a release with those, and
``FOLDER/answers.npz`` has the answers: a request's number, a stage, a tensor.
"""

import os
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import torch
from hydra.utils import instantiate
from omegaconf import OmegaConf, open_dict

NAMES = ("pose", "root", "vqvae")
POINTER = b"version https://git-lfs"


def main() -> None:
    """Answers every request."""
    code, requests, folder = (Path(text).resolve() for text in sys.argv[1:])
    sys.path.insert(0, str(code))
    os.chdir(code)  # configurations name files from here
    torch.manual_seed(1)
    models = {name: build(name) for name in ("pose", "root")}
    checkpoints = {name: next(Path(f"out/motionbricks_{name}/version_1/checkpoints").glob("*.ckpt")) for name in NAMES}
    if any(path.read_bytes()[: len(POINTER)] == POINTER for path in checkpoints.values()):
        draw(models, checkpoints, folder / "release")
        print("random weights: the checkpoints are pointers of Git LFS")
    else:
        (folder / "release").symlink_to(code)
        for name, model in models.items():
            state = torch.load(checkpoints[name], map_location="cpu", weights_only=False)["state_dict"]
            model.load_state_dict(state)
        print("the release's own weights")
    answers: dict[str, Any] = {}
    given = np.load(requests)
    with torch.no_grad():
        for number in range(int(given["count"])):
            request = {key.split("/")[1]: torch.from_numpy(given[key]) for key in given if key.startswith(f"{number}/")}
            for key, value in answer(models, request).items():
                answers[f"{number}/{key}"] = value.numpy()
    np.savez(folder / "answers.npz", **answers)


def build(name: str) -> Any:
    """A model as its configuration has it."""
    from motionbricks.helper.pl_util import load_motion_rep

    conf = OmegaConf.load(f"out/motionbricks_{name}/version_1/hparams.yaml")
    motion_rep = load_motion_rep(conf)
    with open_dict(conf):
        for key in ("optimizer", "scheduler"):
            conf.model.pop(key, None)
    tokenizer = None
    if conf.model.pose_vqvae_network is not None:
        tokenizer = instantiate(conf.model.pose_vqvae_network, motion_rep=motion_rep.dual_rep.local_motion_rep)
    backbone = instantiate(conf.model.backbone_network, motion_rep=motion_rep)
    path = conf.model.args.vqvae_model_ckpt_path
    if path and Path(path).is_file() and Path(path).stat().st_size < 1000:
        conf.model.args.vqvae_model_ckpt_path = "missing"
    return instantiate(conf.model, pose_vqvae_network=tokenizer, backbone_network=backbone, motion_rep=motion_rep)


def draw(models: dict[str, Any], checkpoints: dict[str, Path], release: Path) -> None:
    """Draws weights, those of biases and norms too, and writes the release that has them.

    Weights are larger than PyTorch draws them, or little of the requests would be left in the answers.
    """
    pose, root = models["pose"], models["root"]
    tokenizer = pose.supporting_nets["pose_net"]
    for module in (pose.backbone_net, root.backbone_net, tokenizer):
        for parameter in module.parameters():
            if parameter.dim() == 1:
                parameter.data += 0.1 * torch.randn_like(parameter)
        for name, layer in module.named_modules():
            if isinstance(layer, torch.nn.Conv1d | torch.nn.Linear) and "transformer" not in name:
                layer.weight.data *= 2.0
    tokenizer.quantizer.vq._codebook.embed.copy_(torch.randn_like(tokenizer.quantizer.vq._codebook.embed))
    pose._vqvae_model_loaded = True
    pose.backbone_net.initted[:] = True
    states = {
        "pose": pose.state_dict(),
        "root": root.state_dict(),
        "vqvae": {f"pose_net.{key}": value for key, value in tokenizer.state_dict().items()},
    }
    for name in NAMES:
        source, out = Path(f"out/motionbricks_{name}"), release / "out" / f"motionbricks_{name}"
        shutil.copytree(source, out, ignore=shutil.ignore_patterns("*.ckpt"))
        path = out / "version_1" / "checkpoints" / checkpoints[name].name
        path.parent.mkdir(exist_ok=True)
        torch.save({"state_dict": states[name], "global_step": 0}, path)


def answer(models: dict[str, Any], request: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """The root stage's own answer to a request, and those of later stages on the request's own trajectory."""
    from motionbricks.motion_backbone.inference.motion_inference import motion_inference
    from motionbricks.motionlib.core.utils.rotations import matrix_to_cont6d

    runner = motion_inference(models, models["pose"].args, device="cpu")
    dual, root = runner.motion_rep.dual_rep, request["global_root"][None]
    frames, slots = root.shape[1], [0, 1, 2, 3, -4, -3, -2, -1]
    local = dual.global_to_local(root, is_normalized=False, to_normalize=False, lengths=torch.tensor([frames]))
    ground = root * torch.tensor([1.0, 0.0, 1.0, 0.0, 0.0])
    start = ground[:, :1]
    places = (request["positions"][None] - ground[:, :, None, :3])[:, :, 1:].flatten(2)
    poses = torch.cat([places, matrix_to_cont6d(request["rotations"][None]).flatten(2)], -1)
    masks = {name: request[f"has_{name}"][None].bool() for name in ("global_root", "local_root", "pose")}
    counts = runner._root_model.backbone_net
    calls: dict[str, torch.Tensor] = {}
    hooks = [
        counts.register_forward_hook(lambda _, __, made: calls.update(counts=made["num_token_logits"], **made)),
        runner._pose_model.backbone_net.register_forward_hook(
            lambda _, read, made: calls.update(
                {f"tokens{len(calls)}": read[0].clone(), f"logits{len(calls)}": made["pose_logits"].clone()}
            )
        ),
    ]

    def run(has_local: torch.Tensor, allowed: torch.Tensor, config: dict[str, Any]) -> torch.Tensor:
        calls.clear()
        keyed = [values[:, slots].clone() for values in (root, local, poses)]
        given = [masks["global_root"], has_local, masks["pose"]]
        pairs = [tensor for pair in zip(keyed, given, strict=True) for tensor in pair]
        common = {"allow_pred_out_of_reach_num_tokens": False, "pose_token_sampling_use_argmax": True}
        made, _ = runner.predict(
            *pairs,
            torch.full([1, 1], counts.MASKED_NUM_TOKENS),
            allowed_pred_num_tokens=allowed,
            config=common | config,
        )
        return made

    run(masks["local_root"], request["allowed_counts"][None].long(), {})
    answers = {
        "root/num_tokens": calls["pred_num_tokens"].flatten(),
        "root/count_probs": calls["counts"][0].softmax(-1)[: len(request["allowed_counts"])],
        "root/global_root": runner.global_motion_rep.unnormalize(calls["pred_global_root_values"])[0] + start[0],
    }
    # The pack's decoder does not see a velocity that was asked of the last frame: there is none.
    no_last = masks["local_root"].clone()
    no_last[:, -1] = False
    only = torch.zeros_like(request["allowed_counts"])[None].long()
    only[0, frames // counts.get_num_frames_per_token() - counts.args["min_tokens"]] = 1
    centred = runner.global_motion_rep.normalize(root - start)
    own = {"debug_ground_truth_root_trajectories": centred, "num_inference_step": 2}
    made = run(no_last, only, own)[0, :frames]
    steps = sorted((key for key in calls if key.startswith("tokens")), key=lambda key: int(key[6:]))
    for step, key in enumerate(steps):
        answers[f"pose/tokens{step}"] = calls[key][0]
        answers[f"pose/logits{step}"] = calls[f"logits{key[6:]}"][0]
    index = runner.global_motion_rep.indices
    answers["decoder/tokens"] = calls[f"logits{steps[-1][6:]}"][0].argmax(-1)
    answers["decoder/rotations"] = made[:, index["global_rot_data"]]
    answers["decoder/refined_root"] = made[:, index["root"]]
    answers["decoder/contacts"] = made[:, index["foot_contacts"]]
    for hook in hooks:
        hook.remove()
    return answers


if __name__ == "__main__":
    main()
