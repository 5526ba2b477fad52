"""The table of options, and what checkpoints and commands refuse."""

from pathlib import Path

import pytest
import torch

from tests_support import job
from troupe_training.cli import main as command_line
from troupe_training.cli.options import COMMANDS, OPTIONS
from troupe_training.train.checkpoints import read_checkpoint, write_checkpoint


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_says_what_it_does(name: str, capsys: pytest.CaptureFixture):
    with pytest.raises(SystemExit, match="0"):
        command_line.main([*name.split(), "--help"])
    assert " ".join((COMMANDS[name][0].__doc__ or "").split())[:60] in " ".join(capsys.readouterr().out.split())


def test_every_option_is_some_commands(capsys: pytest.CaptureFixture):
    helps = ""
    for name in COMMANDS:
        with pytest.raises(SystemExit):
            command_line.main([*name.split(), "--help"])
        helps += capsys.readouterr().out
    assert [option for option in OPTIONS if option.startswith("--") and f"{option} " not in helps + " "] == []


def test_checkpoints_hold_values_and_no_code(tmp_path: Path):
    torch.save({"step": 3, "meta": Path("x")}, tmp_path / "root.pt")
    with pytest.raises(Exception, match="Path"):
        read_checkpoint(tmp_path / "root.pt")


def test_a_network_out_of_a_pack_is_refined_and_not_trained(tmp_path: Path):
    model = torch.nn.Linear(1, 1)
    weights = model.state_dict()
    state = {
        "stage": "root",
        "meta": {},
        "model": weights,
        "average": weights,
        "step": 1,
        "seconds": 0.0,
        "history": [],
    }
    write_checkpoint(tmp_path / "root.pt", state)
    with pytest.raises(SystemExit, match="came out of a pack"):
        job(tmp_path, tmp_path, 3).fit("root", model, {}, lambda *_: {})
