"""A release in NVIDIA's layout with tiny networks and random numbers: configurations, statistics, skeleton, checkpoints."""

from pathlib import Path
from typing import Any

import numpy as np
import torch
import yaml
from torch import Generator, Tensor

from troupe_training.data.skeleton import Skeleton
from troupe_training.export.manifest import read_manifest
from troupe_training.export.motionbricks.official.release import NAMES, POSE_FEATURE

G1 = Path(__file__).parents[2] / "models" / "g1"
JOINTS, COUNTS, FEEDFORWARD = len(NAMES), 11, 2048
POSE, LOCAL = 1 + 3 * 33 + 6 * 34, 4 + 3 * 33 + 9 * 34 + 4
WIDTH, HALVINGS, DEPTH, CODES, CODE_WIDTH = 16, 2, 2, 3, 8
Shapes = dict[str, tuple[int, ...]]


def linear(name: str, outputs: int, inputs: int) -> Shapes:
    return {f"{name}.weight": (outputs, inputs), f"{name}.bias": (outputs,)}


def perceptron(name: str, inputs: int, width: int, outputs: int) -> Shapes:
    return {
        **linear(f"{name}.fc_layers.0", width, inputs),
        **linear(f"{name}.fc_layers.1", width, width),
        **linear(f"{name}.forward_projection", outputs, width),
    }


def transformer(name: str, layers: int) -> Shapes:
    shapes: Shapes = {}
    for i in range(layers):
        own = f"{name}.layers.{i}"
        shapes |= {f"{own}.self_attn.in_proj_weight": (3 * WIDTH, WIDTH), f"{own}.self_attn.in_proj_bias": (3 * WIDTH,)}
        shapes |= linear(f"{own}.self_attn.out_proj", WIDTH, WIDTH)
        shapes |= linear(f"{own}.linear1", FEEDFORWARD, WIDTH) | linear(f"{own}.linear2", WIDTH, FEEDFORWARD)
        for norm in ("norm1", "norm2"):
            shapes |= {f"{own}.{norm}.weight": (WIDTH,), f"{own}.{norm}.bias": (WIDTH,)}
    return shapes


def decoder(name: str, inputs: int, outputs: int, target: int, along: int) -> Shapes:
    def window(at: str, out: int, into: int, taps: int = 3) -> Shapes:
        return {f"{name}.{at}.weight": (out, into, taps), f"{name}.{at}.bias": (out,)}

    shapes = window("model.0", WIDTH, inputs)
    for i in range(HALVINGS):
        stacked = 2 ** (HALVINGS - i)
        shapes |= linear(f"{name}.target_cond_blocks.{2 * i}", WIDTH // stacked, target)
        shapes |= linear(f"{name}.external_cond_blocks.{2 * i}", WIDTH, stacked * along + WIDTH)
        for block in range(DEPTH):
            shapes |= window(f"model.{2 + i}.0.model.{block}.conv1", WIDTH, WIDTH)
            shapes |= window(f"model.{2 + i}.0.model.{block}.conv2", WIDTH, WIDTH, taps=1)
        shapes |= window(f"model.{2 + i}.2", WIDTH, WIDTH)
    return shapes | window(f"model.{2 + HALVINGS}", WIDTH, WIDTH) | window(f"model.{4 + HALVINGS}", outputs, WIDTH)


def root_shapes() -> Shapes:
    return {
        **linear("_proj_local_pose", 8, POSE),
        **linear("_proj_local_root_value", 4, 4),
        **linear("_proj_global_root_value", 4, 5),
        "_no_local_pose_emb": (8,),
        "_no_local_root_emb": (4,),
        "_no_global_root_emb": (4,),
        "_conv_no_frame_emb": (WIDTH,),
        **perceptron("_proj_start_input", 16, WIDTH, WIDTH),
        **perceptron("_proj_end_input", 16, WIDTH, WIDTH),
        "_input_position_emb.weight": (8, WIDTH),
        "_proj_input_num_tokens.weight": (COUNTS + 2, WIDTH),
        "_position_emb.embed": (16, 1, WIDTH),
        **linear("_proj_num_token_output_logit", COUNTS + 1, WIDTH),
        "_middle_token_emb.weight": (COUNTS + 1, WIDTH),
        **transformer("_shared_transformer_model", 1),
        **transformer("_root_token_transformer_model", 1),
        **decoder("_conv_output", WIDTH, 5, target=5, along=WIDTH),
    }


def pose_shapes() -> Shapes:
    return {
        "_pose_token_emb.weight": (2 * (CODES + 1), CODE_WIDTH // 2),
        **perceptron("_proj_pose_token_emb", CODE_WIDTH, 16, 16),
        **linear("_proj_local_root_values", 4, 16),
        **linear("_proj_local_pose", 4, POSE),
        "_proj_num_valid_positions.weight": (COUNTS, 4),
        **linear("_proj_input.0", WIDTH, 16 + 4 + 4),
        "_position_emb.embed": (16, 1, WIDTH),
        **linear("_proj_pose_output_logit", 2 * CODES, WIDTH),
        **transformer("_transformer_model", 2),
    }


def tokenizer_shapes() -> Shapes:
    return {
        "quantizer.vq._codebook.embed": (2, CODES, CODE_WIDTH // 2),
        **decoder("decoder", CODE_WIDTH, LOCAL, target=POSE, along=2),
    }


def drawn(shapes: Shapes, prefix: str, generator: Generator) -> dict[str, Tensor]:
    """Weights of deviation 1/sqrt(inputs), so that answers have the size of what is read."""
    state = {}
    for name, shape in shapes.items():
        inputs = max(1, int(np.prod(shape[1:])))
        state[prefix + name] = torch.randn(shape, generator=generator) * inputs**-0.5
    return state


def configurations() -> dict[str, dict[str, Any]]:
    shared = {"min_tokens": 6, "max_tokens": 16, "down_t": HALVINGS, "local_pose_feature": POSE_FEATURE}
    convolutions = {"width": WIDTH, "depth": DEPTH, "dilation_growth_rate": 3, "activation": "relu", "norm": "None"}
    root = {
        **{"n_embd": WIDTH, "n_head": 2, "n_layers_shared": 1, "n_layers_root_token": 1, "pose_feat_dim": 8},
        **{"local_root_feat_dim": 4, "global_root_feat_dim": 4, "input_feat_mlp_num_layers": 2},
    }
    pose = {
        **{"n_embd": WIDTH, "n_head": 2, "n_layers": 2, "pose_feat_width": 16, "root_feat_width": 4},
        **{"token_length_feat_width": 4, "pose_token_mlp_num_layers": 2},
    }
    tokenizer = {
        **{"quantizer_strategy": "multihead_ema_reset", "nb_code": CODES**2, "code_dim": CODE_WIDTH, "num_heads": 2},
        "feature_mode": [POSE_FEATURE, "pose", POSE_FEATURE, "root_without_hip_height_without_heading"],
        "cond_fusion_last_layer": False,
    }
    features = {"local_root_feature": "root", "global_root_feature": "root"}
    along = {"cond_root_feature_is_from_motion_rep": "global", "cond_root_feature": "root_without_hip_height"}
    hard = {"use_hard_num_token_emb_for_root_prediction": True}
    referring = {key: f"${{model.args.{key}}}" for key in ("min_tokens", "max_tokens", "down_t")}
    models: dict[str, dict[str, Any]] = {
        "root": {"args": shared | features | hard, "backbone_network": {"args": root | convolutions | referring}},
        "pose": {"args": shared | along, "backbone_network": {"args": pose | referring}},
        "vqvae": {"args": shared, "pose_vqvae_motion_rep": "local", "pose_vqvae_network": tokenizer | convolutions},
    }
    common = {"fps": 30, "skeleton": {"base_name": "g1skel34"}, "data": {"text_embeddings": None}}
    return {name: common | {"model": model} for name, model in models.items()}


def folder_of(release: Path, model: str) -> Path:
    return release / "out" / f"motionbricks_{model}" / "version_1"


def write_release(folder: Path, clips: bool = True) -> Path:
    """Writes the release and returns its folder."""
    generator = Generator().manual_seed(3)
    skeleton = Skeleton.of_manifest(read_manifest(G1))
    parents = [NAMES.index(skeleton.names[p]) if p >= 0 else -1 for p in _in_their_order(skeleton, skeleton.parents)]
    places = torch.zeros(JOINTS, 3)
    for joint, offset in enumerate(_in_their_order(skeleton, skeleton.offsets)):
        places[joint] = torch.tensor(offset) + (places[parents[joint]] if joint else 0.0)
    states = {
        "root": drawn(root_shapes(), "backbone_net.", generator),
        "pose": drawn(pose_shapes(), "backbone_net.", generator) | {"backbone_net.initted": torch.tensor([True])},
        "vqvae": drawn(tokenizer_shapes(), "pose_net.", generator),
    }
    mean = torch.randn(5 + LOCAL, generator=generator).numpy() * 0.3
    std = torch.rand(5 + LOCAL, generator=generator).numpy() + 0.2
    for model, configuration in configurations().items():
        own = folder_of(folder, model)
        for part in ("checkpoints", "stats/motion", "skeleton"):
            (own / part).mkdir(parents=True)
        (own / "hparams.yaml").write_text(yaml.safe_dump(configuration))
        np.save(own / "stats/motion/mean.npy", mean)
        np.save(own / "stats/motion/std.npy", std)
        torch.save(places[None], own / "skeleton/joints.p")
        torch.save(torch.tensor(parents), own / "skeleton/parents.p")
        torch.save({"state_dict": states[model], "global_step": 1}, own / "checkpoints/model-step=2000000.ckpt")
    if clips:
        write_clips(folder / "out" / "G1-clip.ckpt")
    return folder


def _in_their_order(skeleton: Skeleton, values: list[Any]) -> list[Any]:
    return [values[skeleton.names.index(name)] for name in NAMES]


def write_clips(path: Path) -> None:
    """Clips that stand upright and face to the left; the root of clip k is 0.5 + k/100 m high."""
    frames = 20
    facing = torch.tensor([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    positions = torch.zeros(15, frames, JOINTS, 3)
    positions[:, :, 0, 1] = 0.5 + torch.arange(15)[:, None] / 100
    clips = {
        "global_joint_rotations": facing.expand(15, frames, JOINTS, 3, 3).contiguous(),
        "global_joint_positions": positions,
        "num_frames_per_clip": torch.tensor([frames - 5, *([frames] * 14)], dtype=torch.int32),
    }
    torch.save(clips, path)
