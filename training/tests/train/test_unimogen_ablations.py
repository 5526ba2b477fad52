"""Each ablation changes the network or the loss in the way that is meant, and nothing else."""

from pathlib import Path

import numpy as np
import pytest
import torch

from troupe_training.cli.main import main
from troupe_training.data.bodies_store import BALANCE, BODY_BALANCE, SPEED_BALANCE, Corpus
from troupe_training.models.unimogen.config import PRESETS
from troupe_training.models.unimogen.network import UniMoGen, slot_matrix
from troupe_training.models.unimogen.sampler import INPUTS, Batch, Character
from troupe_training.models.unimogen.state import Path2D, Range, encode, root_offsets
from troupe_training.train.checkpoints import read_checkpoint
from troupe_training.train.unimogen.ablations import (
    ABLATIONS,
    ablated_balance,
    ablated_config,
    ablated_range,
    ablated_weights,
)
from troupe_training.train.unimogen.stage import load
from unimogen_support import biped

WORDS = 3


def network(*without: str) -> UniMoGen:
    torch.manual_seed(0)
    model = UniMoGen(ablated_config(PRESETS["tiny"], without), WORDS)
    for parameter in model.parameters():  # layers that begin at zero would hide what they read
        parameter.data += 0.1 * torch.randn_like(parameter)
    return model.eval().requires_grad_(False)


def inputs(characters: int = 2, frames: int = 20) -> list[torch.Tensor]:
    rng = np.random.default_rng(3)
    path = rng.standard_normal((frames, 3)).astype(np.float32)
    batch = Batch([Character(biped(), path, np.ones(WORDS, np.float32), seed) for seed in range(characters)])
    arrays = batch.constant | {"x": np.concatenate(batch.state), "step": np.full(characters, 30.0, np.float32)}
    return [torch.from_numpy(np.ascontiguousarray(arrays[name])) for name in INPUTS]


def weights_of(model: UniMoGen) -> int:
    return sum(p.numel() for p in model.parameters())


def deep_rows(model: UniMoGen, x: torch.Tensor) -> torch.Tensor:
    rows, reads = (torch.from_numpy(part) for part in biped().slots())
    return model.deep_in[0].joints(x, rows, reads.float())


def test_nothing_left_out_is_the_method_itself():
    assert ablated_config(PRESETS["tiny"], []) == PRESETS["tiny"]
    assert ablated_balance(BALANCE, []) == (BALANCE, BODY_BALANCE, SPEED_BALANCE)
    limits = Range(torch.zeros(3), torch.ones(3))
    assert ablated_range(limits, []) is limits
    assert ablated_weights([]).position > 0


def test_without_min_max_the_root_goes_in_as_shares_of_the_size():
    limits = ablated_range(Range(torch.full((3,), -0.1), torch.full((3,), 0.2)), ["min-max"])
    body, root = biped(), torch.randn(1, 4, 3, generator=torch.Generator().manual_seed(0))
    path = Path2D(torch.zeros(1, 4, 2), torch.zeros(1, 4))
    bends = torch.tensor([1.0, 0, 0, 0, 1, 0]).repeat(1, 4, 8, 1)
    rows = encode(body, root, bends, path, limits)
    torch.testing.assert_close(rows[:, 0, :, :3], root_offsets(body, root, path))


def test_merged_attention_has_as_many_weights_and_reads_other_frames_of_ancestors():
    plain, merged = network(), network("separate-attention")
    assert merged.deep_in[0].time is None
    assert abs(weights_of(merged) / weights_of(plain) - 1) < 0.02
    x = torch.randn(9, 5, 32, generator=torch.Generator().manual_seed(1))
    other = x.clone()
    other[1, 0] = torch.randn(32, generator=torch.Generator().manual_seed(2))  # the root joint's first frame
    for model, seen in ((plain, False), (merged, True)):
        apart = (deep_rows(model, other) - deep_rows(model, x)).abs().amax(-1)  # [J + 1, T]
        assert bool(apart[5, 4] > 1e-5) == seen  # a foot's last frame
        assert apart[5, 0] > 1e-5
    # Rows that a foot does not read stay unseen.
    other = x.clone()
    other[8] = -other[8]
    assert (deep_rows(merged, other) - deep_rows(merged, x))[5].abs().max() < 1e-6


def test_gathered_and_dense_merged_attention_agree():
    model, rows = network("separate-attention"), [torch.from_numpy(part) for part in biped().slots()]
    given = inputs()
    torch.testing.assert_close(model(*given), model(*given, slot_of=slot_matrix(*rows)), atol=1e-5, rtol=1e-4)


def test_without_positions_attention_knows_no_order():
    plain, model = network(), network("positions")
    assert not [name for name in model.state_dict() if "slot_bias" in name or name.startswith("position.")]
    assert weights_of(model) < weights_of(plain)
    x = torch.randn(9, 5, 32, generator=torch.Generator().manual_seed(1))
    rows, reads = (torch.from_numpy(part) for part in biped().slots())
    reads, shuffled = reads.float(), torch.randperm(rows.shape[1], generator=torch.Generator().manual_seed(2))
    for one, same in ((plain, False), (model, True)):
        joints = one.deep_in[0].joints
        moved = joints(x, rows[:, shuffled], reads[:, shuffled])
        assert torch.allclose(moved, joints(x, rows, reads), atol=1e-5) == same


def test_without_balance_kinds_and_bodies_come_by_their_length(corpus_cache: Path):
    balance, body_balance, speed_balance = ablated_balance(0.5, ["balance"])
    corpus = Corpus(corpus_cache, "train", balance=balance, speed_balance=speed_balance)
    generator = torch.Generator().manual_seed(0)
    frames = {name: store.frames for name, store in corpus.stores.items()}
    drawn = [corpus.draw_body(20, generator, body_balance) for _ in range(4000)]
    share = frames["walker"] / sum(frames.values())
    assert drawn.count("walker") / 4000 == pytest.approx(share, abs=0.03)
    shares = corpus.stores["walker"]._table(20)[2].diff()
    assert float(shares.max() / shares.min()) == pytest.approx(1.0, abs=1e-6)


def test_without_auxiliary_losses_clean_rows_remain():
    weights = ablated_weights(["auxiliary-losses"])
    assert (weights.angular_velocity, weights.position, weights.velocity) == (0, 0, 0)
    assert (weights.foot, weights.way) == (0, 0)
    assert weights.clean == 1.0 and weights.place > 0


def test_a_run_keeps_what_it_was_begun_without(corpus_cache: Path, tmp_path: Path):
    argv = ["unimogen", "train", "--cache", str(corpus_cache), "--run", str(tmp_path), "--unimogen-preset", "tiny"]
    argv += ["--rows-per-step", "1500", "--threads", "1", "--steps"]
    assert main([*argv, "26", "--without", *ABLATIONS]) == 0
    meta = read_checkpoint(tmp_path / "unimogen.pt")["meta"]
    assert meta["without"] == sorted(ABLATIONS) and meta["balance"] == 1.0
    last = read_checkpoint(tmp_path / "unimogen.pt")["history"][-1]
    assert last["clean"] > 0 and last["position"] == last["velocity"] == last["foot"] == last["angular_velocity"] == 0
    trained = load(tmp_path)
    assert trained.model.config.merged_attention and not trained.model.config.positions
    assert trained.limits.low.tolist() == [-1, -1, -1] and trained.limits.high.tolist() == [1, 1, 1]
    with pytest.raises(SystemExit, match="begun without auxiliary-losses, balance"):
        main([*argv, "30"])
