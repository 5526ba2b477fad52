"""How roots sway: measured in made-up walks, and written into a pack."""

import math
import tomllib
from pathlib import Path

import pytest
import torch

from troupe_training.data.conventions import FPS
from troupe_training.evaluate.unimogen.sway import FRAMES, Strides, _gait, _strides
from troupe_training.export.unimogen.sway import write_sway

RATE_HZ, SPEEDS_MPS = 0.9, torch.linspace(0.8, 1.4, 7)


def walks() -> Strides:
    """Seven walks to all sides. The left foot and the root are ahead at phase 0, the root is to the left a quarter later."""
    time = torch.arange(FRAMES) / FPS
    phase = 2 * math.pi * RATE_HZ * time + torch.arange(7.0)[:, None]
    heading = torch.arange(7.0)[:, None].expand(-1, FRAMES)
    ahead = torch.stack([torch.sin(heading), torch.cos(heading)], -1)
    left = torch.stack([torch.cos(heading), -torch.sin(heading)], -1)
    way = SPEEDS_MPS[:, None] * time + 0.01 * torch.cos(2 * phase)
    ground = way[..., None] * ahead + 0.03 * torch.sin(phase)[..., None] * left
    root = torch.stack([ground[..., 0], torch.ones_like(way), ground[..., 1]], -1)
    apart = 0.5 * torch.cos(phase)[..., None] * ahead
    feet = torch.zeros(7, FRAMES, 2, 3)
    feet[:, :, 0, [0, 2]], feet[:, :, 1, [0, 2]] = ground + apart / 2, ground - apart / 2
    return _strides(root, heading + 0.1 * torch.cos(phase), feet, torch.arange(7))


def test_the_sway_of_a_walk_is_found_to_each_side():
    found = walks()
    torch.testing.assert_close(found.speed_mps.float(), SPEEDS_MPS, atol=0.03, rtol=0)
    assert found.rate_hz.tolist() == pytest.approx([RATE_HZ] * 7, abs=0.03)
    want = torch.tensor([[0.0, 0.03, 0.0, 0.0], [0.0, 0.0, 0.01, 0.0], [0.1, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0]])
    torch.testing.assert_close(found.waves.float(), want.expand(7, -1, -1), atol=0.012, rtol=0)


def test_feet_that_do_not_pass_each_other_have_no_stride():
    noise = torch.randn(3, FRAMES, 2, 3, generator=torch.Generator().manual_seed(0))
    root = torch.zeros(3, FRAMES, 3)
    root[..., 2] = torch.arange(FRAMES) / FPS
    assert not len(_strides(root, torch.zeros(3, FRAMES), noise, torch.arange(3)).speed_mps)


def test_a_pack_has_the_newest_table_of_a_body(tmp_path: Path):
    file = tmp_path / "bodies" / "walker.toml"
    file.parent.mkdir()
    file.write_text('name = "walker"\n')
    gait = _gait(walks(), torch.ones(7, dtype=torch.bool))
    assert gait["speeds_mps"] == sorted(gait["speeds_mps"]) and len(gait["speeds_mps"]) == len(gait["stride_m"]) > 1
    for word in ("run", "walk"):
        write_sway(tmp_path, "walker", {"feet": ["l", "r"], "gaits": [gait, {"word": word} | gait]})
        read = tomllib.loads(file.read_text())
        assert read["name"] == "walker" and read["sway"]["feet"] == ["l", "r"]
        assert read["sway"]["gaits"] == [gait, {"word": word} | gait]
    written = file.read_text()
    write_sway(tmp_path, "walker", read["sway"])
    assert file.read_text() == written
    file.write_text(written + "\n# Another table.\n[limits]\nmost = 1\n")
    write_sway(tmp_path, "walker", read["sway"])
    assert file.read_text().count("[sway]") == 1 and "# Another table.\n[limits]\nmost = 1\n" in file.read_text()
    file.write_text(written)
    write_sway(tmp_path, "walker", {})
    assert file.read_text() == 'name = "walker"\n'
