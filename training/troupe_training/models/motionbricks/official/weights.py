"""The release's names for the networks' weights. Every weight of a network must be there, in the shape that its sizes give."""

from collections.abc import Mapping

import torch
from torch import Tensor, nn

from troupe_training.models.motionbricks.official.layers import (
    ConditionedDecoder,
    Perceptron,
    PostNormLayer,
    PostNormTransformer,
    Residual,
    Stage,
    Window,
)
from troupe_training.models.motionbricks.official.networks import PoseDecoder, PoseNetwork, RootNetwork


class WeightsError(ValueError):
    """Weights that do not fit; the message names the one at fault."""


class Weights:
    """Tensors by the release's names, below a prefix."""

    def __init__(self, tensors: Mapping[str, Tensor], prefix: str):
        self.tensors = tensors
        self.prefix = prefix

    def below(self, name: str) -> "Weights":
        """Those of a part."""
        return Weights(self.tensors, f"{self.prefix}{name}.")

    def tensor(self, name: str) -> Tensor:
        """One tensor, in 32 bits."""
        key = self.prefix + name
        if key not in self.tensors:
            raise WeightsError(f"the checkpoint has no {key}")
        return self.tensors[key].detach().float()

    def fill(self, parameter: Tensor, value: Tensor, name: str) -> None:
        """Copies a value that was taken from ``name``."""
        if value.shape != parameter.shape:
            shapes = f"{tuple(value.shape)}, and the configuration asks for {tuple(parameter.shape)}"
            raise WeightsError(f"{self.prefix}{name} has the shape {shapes}")
        with torch.no_grad():
            parameter.copy_(value)

    def copy(self, parameter: Tensor, name: str) -> None:
        """Copies one tensor as it is."""
        self.fill(parameter, self.tensor(name), name)

    def copy_rows(self, parameter: Tensor, name: str) -> None:
        """Copies the first rows of a tensor that has more."""
        self.fill(parameter, self.tensor(name)[: len(parameter)], name)

    def linear(self, module: nn.Linear | nn.LayerNorm, name: str) -> None:
        """Weight and bias."""
        self.copy(module.weight, f"{name}.weight")
        self.copy(module.bias, f"{name}.bias")

    def window(self, module: Window, name: str) -> None:
        """A convolution, its weights laid out as `Window` has them."""
        weight = self.tensor(f"{name}.weight")
        if weight.dim() != 3 or weight.shape[-1] != 3:
            raise WeightsError(f"{self.prefix}{name}.weight is no convolution over three frames: {tuple(weight.shape)}")
        taps = weight if module.taps == 3 else weight[..., 1:2]
        self.fill(module.weight, taps.permute(2, 1, 0).flatten(0, 1), f"{name}.weight")
        self.copy(module.bias, f"{name}.bias")

    def perceptron(self, module: Perceptron, name: str) -> None:
        """Hidden layers, then the last."""
        part = self.below(name)
        for i, layer in enumerate(module.hidden):
            assert isinstance(layer, nn.Linear)
            part.linear(layer, f"fc_layers.{i}")
        part.linear(module.out, "forward_projection")

    def transformer(self, module: PostNormTransformer, name: str) -> None:
        """PyTorch's own encoder layers."""
        for i, layer in enumerate(module.layers):
            assert isinstance(layer, PostNormLayer)
            part = self.below(f"{name}.layers.{i}")
            part.copy(layer.qkv.weight, "self_attn.in_proj_weight")
            part.copy(layer.qkv.bias, "self_attn.in_proj_bias")
            part.linear(layer.out, "self_attn.out_proj")
            part.linear(layer.up, "linear1")
            part.linear(layer.down, "linear2")
            part.linear(layer.norm1, "norm1")
            part.linear(layer.norm2, "norm2")

    def decoder(self, module: ConditionedDecoder, name: str) -> None:
        """Convolutions of all frame rates, and what joins conditions in."""
        part, stages = self.below(name), len(module.stages)
        part.window(module.enter, "model.0")
        for i, stage in enumerate(module.stages):
            assert isinstance(stage, Stage)
            part.linear(stage.target, f"target_cond_blocks.{2 * i}")
            part.linear(stage.join, f"external_cond_blocks.{2 * i}")
            for j, block in enumerate(stage.blocks):
                assert isinstance(block, Residual)
                own = part.below(f"model.{2 + i}.0.model.{j}")
                own.window(block.wide, "conv1")
                narrow = own.tensor("conv2.weight")
                own.fill(block.narrow.weight, narrow.squeeze(-1), "conv2.weight")
                own.copy(block.narrow.bias, "conv2.bias")
            part.window(stage.leave, f"model.{2 + i}.2")
        part.window(module.mix, f"model.{2 + stages}")
        part.window(module.leave, f"model.{4 + stages}")


def read_root(module: RootNetwork, tensors: Mapping[str, Tensor]) -> None:
    """Fills the root network from the checkpoint of the root model."""
    weights = Weights(tensors, "backbone_net.")
    weights.linear(module.pose, "_proj_local_pose")
    weights.linear(module.local_root, "_proj_local_root_value")
    weights.linear(module.global_root, "_proj_global_root_value")
    weights.copy(module.no_pose, "_no_local_pose_emb")
    weights.copy(module.no_local_root, "_no_local_root_emb")
    weights.copy(module.no_global_root, "_no_global_root_emb")
    weights.copy(module.no_frame, "_conv_no_frame_emb")
    weights.perceptron(module.start, "_proj_start_input")
    weights.perceptron(module.end, "_proj_end_input")
    weights.copy(module.slots, "_input_position_emb.weight")
    # After the counts come one for more than the most, and one for a count that is not given.
    counts, name = module.sizes.counts, "_proj_input_num_tokens.weight"
    asked = weights.tensor(name)
    if len(asked) != counts + 2:
        raise WeightsError(f"{weights.prefix}{name} has {len(asked)} rows, expected {counts + 2}")
    weights.fill(module.any_count, asked[counts + 1], name)
    weights.transformer(module.first, "_shared_transformer_model")
    weights.copy_rows(module.count_logits.weight, "_proj_num_token_output_logit.weight")
    weights.copy_rows(module.count_logits.bias, "_proj_num_token_output_logit.bias")
    weights.copy_rows(module.count, "_middle_token_emb.weight")
    weights.transformer(module.later, "_root_token_transformer_model")
    weights.fill(module.positions, weights.tensor("_position_emb.embed")[:, 0], "_position_emb.embed")
    weights.decoder(module.decoder, "_conv_output")


def read_pose(module: PoseNetwork, tensors: Mapping[str, Tensor]) -> None:
    """Fills the pose network from the checkpoint of the pose model."""
    weights = Weights(tensors, "backbone_net.")
    weights.copy(module.codes, "_pose_token_emb.weight")
    weights.perceptron(module.token, "_proj_pose_token_emb")
    weights.linear(module.root, "_proj_local_root_values")
    weights.linear(module.pose, "_proj_local_pose")
    weights.copy(module.length, "_proj_num_valid_positions.weight")
    weights.linear(module.join, "_proj_input.0")
    weights.fill(module.positions, weights.tensor("_position_emb.embed")[:, 0], "_position_emb.embed")
    weights.transformer(module.transformer, "_transformer_model")
    weights.linear(module.logits, "_proj_pose_output_logit")


def read_decoder(module: PoseDecoder, tensors: Mapping[str, Tensor]) -> None:
    """Fills the decoder from the checkpoint of the tokenizer, whose encoder a server does not need."""
    weights = Weights(tensors, "pose_net.")
    name = "quantizer.vq._codebook.embed"
    weights.fill(module.book, weights.tensor(name).reshape(module.book.shape), name)
    weights.decoder(module.decoder, "decoder")
