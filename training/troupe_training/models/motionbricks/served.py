"""The networks as a pack ships them: inputs and outputs are what the pack contract names."""

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from troupe_training.data.roots import integrate_root
from troupe_training.models.motionbricks.carried import usual_heights
from troupe_training.models.motionbricks.config import COUNTS, MIN_TOKENS
from troupe_training.models.motionbricks.pose_module import PoseModule
from troupe_training.models.motionbricks.root_choice import RootChoice, envelope
from troupe_training.models.motionbricks.root_module import RootModule, RootPass, baseline_trajectory
from troupe_training.models.motionbricks.tokenizer import Tokenizer

# Outputs of each stage, in order.
OUTPUTS = {
    "root": ["num_tokens", "count_probs", "global_root"],
    "pose": ["logits"],
    "decoder": ["rotations", "refined_root", "contacts"],
}


class RootStage(nn.Module):
    """The exported root module: masks, counts and trajectory as the pack contract names them.

    With a ``choice`` it has one more input, ``root_noise``: zeros, or standard normal numbers times a temperature.
    """

    def __init__(self, module: RootModule, choice: RootChoice | None = None):
        super().__init__()
        self.module = module
        self.choice = choice

    def forward(
        self,
        key_local_root: Tensor,
        key_global_root: Tensor,
        key_pose: Tensor,
        has_local_root: Tensor,
        has_global_root: Tensor,
        has_pose: Tensor,
        allowed_counts: Tensor,
        count_noise: Tensor,
        root_noise: Tensor | None = None,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Slot values ``[B, 8, .]``, masks ``[B, 8]``, counts ``[B, 14]``, noise ``[B, K]``; what comes out, `OUTPUTS` names."""
        module = self.module
        values = {"local_root": key_local_root, "global_root": key_global_root, "pose": key_pose}
        f = module.constraints(values, {"local_root": has_local_root, "global_root": has_global_root, "pose": has_pose})
        known = (allowed_counts.sum(-1, keepdim=True) < 1.5).to(allowed_counts.dtype)
        hidden, logits = module.count_logits(f, allowed_counts * known, known)
        logits = logits - (1.0 - allowed_counts) * 1e4
        probabilities = torch.softmax(logits, -1)
        index = (logits + count_noise).argmax(-1)
        one_hot = F.one_hot(index, COUNTS).to(allowed_counts.dtype)
        num_tokens = index + MIN_TOKENS
        base = baseline_trajectory(key_local_root, key_global_root, has_global_root, num_tokens)
        refined, valid = module.refined(hidden, f, one_hot, num_tokens)
        root = module.read_out(refined, base)
        if self.choice is not None:
            assert root_noise is not None, "a root stage with a choice needs its noise"
            root = self.choice(RootPass(root, refined, valid, envelope(has_global_root, num_tokens)), root_noise)
        return num_tokens, probabilities, root


class DecoderStage(nn.Module):
    """The exported decoder: tokens in, frames out, every tensor as the pack contract names it.

    It reads out what a server needs. The two columns of a rotation are as the network gives them: who reads them
    orthonormalises (`six_d_to_matrix`), which costs a graph many small operations.
    """

    columns: Tensor
    heights: Tensor
    trust: Tensor

    def __init__(self, tokenizer: Tokenizer):
        super().__init__()
        decoder = tokenizer.decoder
        self.decoder = decoder
        self.quantizer = tokenizer.quantizer
        pose_dim = decoder.joints * 9
        six_d = torch.arange(pose_dim).reshape(decoder.joints, 9)[:, 3:].flatten()
        root = torch.arange(pose_dim, pose_dim + 4)
        contacts = torch.arange(decoder.contacts) + pose_dim + 4 + decoder.joints * 3
        columns = torch.cat([six_d, root, contacts]).to(decoder.leave.weight.device)
        self.register_buffer("columns", columns, persistent=False)
        self.widths = [len(six_d), len(root), len(contacts)]
        self.leave = nn.Linear(decoder.leave.in_features, len(columns), device=columns.device)
        # Rotations come out in physical units less their usual heights, and so does what is
        # carried.
        scale, centre = torch.ones(len(columns)), torch.zeros(len(columns))
        heights = usual_heights(decoder.pose_scale.mean)[six_d]
        scale[: len(six_d)], centre[: len(six_d)] = (
            decoder.pose_scale.std[six_d],
            decoder.pose_scale.mean[six_d] - heights,
        )
        with torch.no_grad():
            self.leave.weight.copy_(decoder.leave.weight[columns] * scale[:, None])
            self.leave.bias.copy_(decoder.leave.bias[columns] * scale + centre)
        self.register_buffer("heights", heights.unflatten(0, (decoder.joints, 6)), persistent=False)
        self.register_buffer("trust", decoder.carried.trust.detach()[:, six_d].clone())

    def forward(
        self, tokens: Tensor, num_tokens: Tensor, global_root: Tensor, frame_pose: Tensor, frame_mask: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Inputs as in `PoseModule.forward`; what comes out, `OUTPUTS` names."""
        decoder = self.decoder
        embedded = self.quantizer.embed(tokens)
        carried, distance = decoder.carry(frame_pose, frame_mask, global_root)
        hidden, local = decoder.hidden(embedded, global_root, decoder.scaled(carried), frame_mask, num_tokens)
        rotations, root, contacts = self.leave(decoder.norm(hidden)).split(self.widths, -1)
        trust = self.trust.index_select(0, distance.flatten()).unflatten(0, distance.shape)
        carried = carried.unflatten(-1, (decoder.joints, 9))[..., 3:].flatten(2)
        rotations = rotations + trust * (carried - rotations)
        return (
            rotations.unflatten(-1, (decoder.joints, 6)) + self.heights,
            integrate_root(global_root[:, 0], decoder.root_scale.invert(local + 0.2 * root)),
            torch.sigmoid(contacts),
        )


@dataclass
class Networks:
    """The trained networks of a pack."""

    tokenizer: Tokenizer
    root: RootModule
    pose: PoseModule
    choice: RootChoice | None = None  # of roots, if it is trained

    @property
    def root_choices(self) -> int:
        """Numbers that choose a root; 0 without a choice."""
        return self.choice.choices if self.choice else 0

    def stages(self) -> dict[str, nn.Module]:
        """The shipped modules by the names of their ONNX files; the pose module as it is."""
        return {"root": RootStage(self.root, self.choice), "pose": self.pose, "decoder": DecoderStage(self.tokenizer)}

    def parameters(self) -> dict[str, int]:
        """How many numbers each network learns; the encoder is counted though packs do not hold it."""
        networks = {
            "encoder": self.tokenizer.encoder,
            "decoder": self.tokenizer.decoder,
            "root": self.root,
            "pose": self.pose,
        }
        counts = {name: sum(t.numel() for t in network.parameters()) for name, network in networks.items()}
        if self.choice:
            counts["root"] += sum(t.numel() for t in self.choice.parameters())
        return counts
