"""A folder of the public release: configurations, statistics, skeleton, checkpoints."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import yaml
from torch import Tensor

from troupe_training.data.conventions import FPS
from troupe_training.export.motionbricks.official.checkpoints import ReleaseError, read_state, read_tensors
from troupe_training.models.motionbricks.official.served import OfficialNetworks
from troupe_training.models.motionbricks.official.sizes import (
    ROOT_GLOBAL,
    ROOT_LOCAL,
    Convolutions,
    Features,
    PoseSizes,
    RootSizes,
    Sizes,
    Transformers,
)
from troupe_training.models.motionbricks.official.weights import read_decoder, read_pose, read_root

LEG = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll", "toe")
ARM = (
    *("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow"),
    *("wrist_roll", "wrist_pitch", "wrist_yaw", "hand"),
)
# The release's skeleton g1skel34, by the names that our pack g1 has for its joints.
NAMES = (
    "pelvis",
    *(f"{side}_{joint}" for side in ("left", "right") for joint in LEG),
    *("waist_yaw", "waist_roll", "waist_pitch"),
    *(f"{side}_{joint}" for side in ("left", "right") for joint in ARM),
)
SKELETON = "g1skel34"
POSE_FEATURE = "joint_positions_and_rotations_and_hip_height"
REFERENCE = re.compile(r"\$\{(?:oc\.select:)?([\w.]+)(?:,(\w+))?\}")
WORDS: dict[str, Any] = {"true": True, "false": False, "null": None}


class Configuration:
    """A configuration file with references of its values to each other."""

    def __init__(self, values: dict[str, Any], path: Path):
        self.values = values
        self.path = path

    @staticmethod
    def read(path: Path) -> "Configuration":
        """Reads the YAML file."""
        if not path.is_file():
            raise ReleaseError(f"{path} is missing")
        return Configuration(yaml.safe_load(path.read_text(encoding="utf-8")), path)

    def get(self, key: str, default: Any = None) -> Any:
        """The value at a dotted name."""
        found: Any = self.values
        for part in key.split("."):
            found = found.get(part) if isinstance(found, dict) else None
        if found is None:
            return default
        reference = REFERENCE.fullmatch(found) if isinstance(found, str) else None
        if reference is None:
            return found
        fallback = reference[2]
        return self.get(reference[1], WORDS.get(fallback, fallback) if fallback else default)

    def number(self, key: str) -> int:
        """A whole number that must be there."""
        value = self.get(key)
        if not isinstance(value, int) or value < 0:
            raise ReleaseError(f"{self.path}: {key} is {value!r}, expected a whole number")
        return value

    def must_be(self, key: str, *allowed: Any) -> None:
        """Refuses a variant of the networks that is not read here."""
        value = self.get(key)
        if value not in allowed:
            expected = " or ".join(repr(one) for one in allowed)
            raise ReleaseError(f"{self.path}: {key} is {value!r}; only {expected} is supported")


@dataclass
class Part:
    """One of the release's three models: its folder and configuration."""

    folder: Path
    configuration: Configuration

    @property
    def checkpoint(self) -> Path:
        """The newest checkpoint."""
        found = sorted(self.folder.glob("checkpoints/*.ckpt"))
        if not found:
            raise ReleaseError(f"{self.folder / 'checkpoints'} has no *.ckpt")
        return found[-1]

    def state(self) -> dict[str, Tensor]:
        """Its weights by name."""
        return read_state(self.checkpoint)


@dataclass
class Release:
    """What a folder holds. Weights are read by `networks`."""

    out: Path
    parts: dict[str, Part]  # root, pose, vqvae
    sizes: Sizes
    features: Features
    offsets: list[list[float]]  # of each joint from its parent, metres; `NAMES` has their order
    parents: list[int]

    @staticmethod
    def read(folder: Path) -> "Release":
        """Of a checkout, its folder ``motionbricks``, or that one's ``out``."""
        places = [folder, folder / "out", folder / "motionbricks" / "out"]
        out = next((place for place in places if (place / "motionbricks_pose").is_dir()), None)
        if out is None:
            raise ReleaseError(f"{folder} has no out/motionbricks_pose: expected a checkout of the release")
        parts = {name: _part(out / f"motionbricks_{name}") for name in ("root", "pose", "vqvae")}
        sizes = sizes_of(parts)
        offsets, parents = _skeleton(parts["pose"].folder / "skeleton")
        return Release(out, parts, sizes, _features(parts, sizes), offsets, parents)

    def networks(self) -> OfficialNetworks:
        """The networks with the release's weights."""
        networks = OfficialNetworks.of(self.sizes, self.features)
        read_root(networks.root, self.parts["root"].state())
        read_pose(networks.pose, self.parts["pose"].state())
        read_decoder(networks.decoder, self.parts["vqvae"].state())
        return networks


def _part(folder: Path) -> Part:
    versions = sorted(folder.glob("version_*"), key=lambda path: (len(path.name), path.name))
    if not versions:
        raise ReleaseError(f"{folder} has no version_*")
    return Part(versions[-1], Configuration.read(versions[-1] / "hparams.yaml"))


def sizes_of(parts: dict[str, Part]) -> Sizes:
    """Sizes by the configurations; refuses variants of the networks that are not implemented."""
    root, pose, tokenizer = (parts[name].configuration for name in ("root", "pose", "vqvae"))
    for part in (root, pose, tokenizer):
        part.must_be("skeleton.base_name", SKELETON)
        part.must_be("fps", FPS)
    for part in (root, pose):
        part.must_be("data.text_embeddings", None)
        part.must_be("model.args.local_pose_feature", POSE_FEATURE)
    for feature in ("local_root_feature", "global_root_feature"):
        root.must_be(f"model.args.{feature}", "root")
    root.must_be("model.args.use_hard_num_token_emb_for_root_prediction", True)
    pose.must_be("model.args.cond_root_feature_is_from_motion_rep", "global")
    pose.must_be("model.args.cond_root_feature", "root_without_hip_height")
    net = "model.pose_vqvae_network"
    tokenizer.must_be("model.pose_vqvae_motion_rep", "local")
    tokenizer.must_be(f"{net}.quantizer_strategy", "multihead_ema_reset")
    tokenizer.must_be(f"{net}.cond_fusion_last_layer", False, None)
    modes = [POSE_FEATURE, "pose", POSE_FEATURE, "root_without_hip_height_without_heading"]
    tokenizer.must_be(f"{net}.feature_mode", modes)
    own = "model.backbone_network.args"
    for part, key in ((root, own), (tokenizer, net)):
        part.must_be(f"{key}.activation", "relu")
        part.must_be(f"{key}.norm", "None", None)
    heads, codes = tokenizer.number(f"{net}.num_heads"), tokenizer.number(f"{net}.nb_code")
    each = round(codes ** (1 / heads))
    if each**heads != codes:
        raise ReleaseError(f"{tokenizer.path}: {codes} codes are no power of {heads} heads")
    for key in ("min_tokens", "max_tokens", "down_t"):
        for part in (pose, tokenizer):
            part.must_be(f"model.args.{key}", root.number(f"model.args.{key}"))
    return Sizes(
        joints=len(NAMES),
        min_tokens=root.number("model.args.min_tokens"),
        max_tokens=root.number("model.args.max_tokens"),
        halvings=root.number("model.args.down_t"),
        heads=heads,
        codes=each,
        code_width=tokenizer.number(f"{net}.code_dim"),
        pose=PoseSizes(
            _transformers(pose, own, "n_layers"),
            pose_features=pose.number(f"{own}.pose_feat_width"),
            root_features=pose.number(f"{own}.root_feat_width"),
            length_features=pose.number(f"{own}.token_length_feat_width"),
            token_layers=pose.number(f"{own}.pose_token_mlp_num_layers"),
        ),
        root=RootSizes(
            _transformers(root, own, "n_layers_shared"),
            later_layers=root.number(f"{own}.n_layers_root_token"),
            pose_features=root.number(f"{own}.pose_feat_dim"),
            local_features=root.number(f"{own}.local_root_feat_dim"),
            global_features=root.number(f"{own}.global_root_feat_dim"),
            slot_layers=root.number(f"{own}.input_feat_mlp_num_layers"),
            convolutions=_convolutions(root, own),
        ),
        decoder=_convolutions(tokenizer, net),
    )


def _transformers(part: Configuration, key: str, layers: str) -> Transformers:
    return Transformers(part.number(f"{key}.n_embd"), part.number(f"{key}.n_head"), part.number(f"{key}.{layers}"))


def _convolutions(part: Configuration, key: str) -> Convolutions:
    return Convolutions(*(part.number(f"{key}.{name}") for name in ("width", "depth", "dilation_growth_rate")))


def _features(parts: dict[str, Part], sizes: Sizes) -> Features:
    """Scales of features: the three models must have the same."""
    arrays = []
    for part in parts.values():
        folder = part.folder / "stats" / "motion"
        try:
            arrays.append([np.load(folder / f"{name}.npy") for name in ("mean", "std")])
        except (OSError, ValueError) as error:
            raise ReleaseError(f"{folder}: {error}") from error
        if not all(np.array_equal(a, b) for a, b in zip(arrays[0], arrays[-1], strict=True)):
            raise ReleaseError(f"{folder} has other statistics than the other models")
    mean, std = (torch.from_numpy(array) for array in arrays[0])
    width = ROOT_GLOBAL + ROOT_LOCAL + sizes.body_width
    if mean.shape != (width,) or std.shape != (width,):
        raise ReleaseError(f"statistics of {tuple(mean.shape)} numbers, expected {width}")
    return Features.of(mean, std, sizes.joints)


def _skeleton(folder: Path) -> tuple[list[list[float]], list[int]]:
    """Offsets and parents of the joints."""
    places, parents = (
        torch.as_tensor(read_tensors(folder / f"{name}.p")[""]).reshape(len(NAMES), -1)
        for name in ("joints", "parents")
    )
    above = [int(parent) for parent in parents.flatten()]
    if above[0] >= 0 or any(not 0 <= parent < joint for joint, parent in enumerate(above[1:], 1)):
        raise ReleaseError(f"{folder / 'parents.p'} is no tree with parents first: {above}")
    offsets = places.double()
    offsets[1:] -= offsets[above[1:]].clone()
    return [[round(float(v), 6) + 0.0 for v in offset] for offset in offsets], above
