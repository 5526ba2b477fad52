"""32 bits for what 16 are too few."""

import functools
from collections.abc import Callable
from typing import ParamSpec, TypeVar

import torch

P = ParamSpec("P")
R = TypeVar("R")


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
