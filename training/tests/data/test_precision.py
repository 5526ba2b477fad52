import pytest
import torch

from troupe_training.data.precision import multiplies_bfloat16


@pytest.mark.parametrize(
    ("says", "multiplies"),
    [({"avx2": True, "avx512_bf16": False}, False), ({"avx512_bf16": True}, True), ({"bf16": True}, True), ({}, False)],
)
def test_a_processor_is_asked_for_bfloat16(
    monkeypatch: pytest.MonkeyPatch, says: dict[str, bool], multiplies: bool
) -> None:
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: says)
    assert multiplies_bfloat16("cpu") is multiplies
    assert multiplies_bfloat16("cuda")
