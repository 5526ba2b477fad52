"""Networks that grow keep what they answer."""

from dataclasses import replace

import pytest
import torch

from troupe_training.export.unimogen.pack import example
from troupe_training.models.unimogen.config import PRESETS
from troupe_training.models.unimogen.grow import grown, kept
from troupe_training.models.unimogen.network import UniMoGen
from unimogen_support import biped

WIDER = replace(PRESETS["tiny"], channels=12, condition=24, attention=12, heads=3, deep_blocks=2)


def test_a_grown_network_answers_nearly_as_before_and_all_of_it_learns():
    torch.manual_seed(0)
    narrow = UniMoGen(PRESETS["tiny"], 5)
    for parameter in narrow.parameters():  # layers that begin at zero would hide what they read
        parameter.data += 0.05 * torch.randn_like(parameter)
    wide = grown(narrow, WIDER)
    inputs = example(narrow, [biped()], (0, 0), 20, seed=1)
    before, after = narrow(*inputs.values()), wide(*inputs.values())
    assert float((after - before).norm() / before.norm()) < 0.02
    optimiser = torch.optim.SGD(wide.parameters(), lr=0.1)
    start = [p.detach().clone() for p in wide.parameters()]
    for _ in range(3):
        optimiser.zero_grad()
        wide(*inputs.values()).square().sum().backward()
        optimiser.step()
    assert all(not torch.equal(a, b) for a, b in zip(start, wide.parameters(), strict=True))
    rows = wide.encoder[0].second.linear.weight[8:]
    assert not torch.allclose(rows[0], rows[1])  # new channels differ from one another


def test_places_of_old_numbers():
    assert kept(4, 6, 2).tolist() == [0, 1, 3, 4]


@pytest.mark.parametrize(
    ("change", "message"),
    [({"channels": 4}, "channels"), ({"attention": 16, "heads": 2}, "width"), ({"positions": False}, "parts")],
)
def test_what_does_not_fit_is_refused(change: dict, message: str):
    with pytest.raises(SystemExit, match=message):
        grown(UniMoGen(PRESETS["tiny"], 5), replace(PRESETS["tiny"], **change))
