"""32 bits for what 16 are too few."""

import functools
from collections.abc import Callable
from typing import ParamSpec, TypeVar

import torch

P = ParamSpec("P")
R = TypeVar("R")

# What processors that multiply in bfloat16 say of themselves. Others take up to thirty times as
# long for it as for 32 bits.
BFLOAT16 = ("avx512_bf16", "amx_bf16", "bf16")


def multiplies_bfloat16(device: str) -> bool:
    """Whether the device multiplies 16-bit numbers by itself: GPUs, and some processors."""
    if torch.device(device).type != "cpu":
        return True
    return any(torch.cpu.get_capabilities().get(name, False) for name in BFLOAT16)


def full_precision(function: Callable[P, R]) -> Callable[P, R]:
    """Runs ``function`` in 32 bits inside autocast too.

    Sixteen bits are enough for the networks' trunks, but not for metres: at three metres from the origin a bfloat16 step
    is more than a centimetre. Geometry, losses and the layers that write metres go through here.
    """

    @functools.wraps(function)
    def exact(*args: P.args, **kwargs: P.kwargs) -> R:
        for device in ("cpu", "cuda"):
            if torch.is_autocast_enabled(device):
                with torch.autocast(device, enabled=False):
                    return function(*args, **kwargs)
        return function(*args, **kwargs)

    return exact
