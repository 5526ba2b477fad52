"""Checkpoints of others: tensors alone are read. Nothing that a file names is imported or run."""

import pickle
from collections import OrderedDict
from pathlib import Path
from types import ModuleType
from typing import Any

import torch
from torch import Tensor

POINTER = b"version https://git-lfs"


class ReleaseError(ValueError):
    """Files that are not those of the release, or not all of them; the message says which, and a way on."""


class Ignored:
    """Stands in for any other class of a checkpoint: that of an optimizer or of a configuration."""

    def __new__(cls, *_: Any, **__: Any) -> "Ignored":
        """Whatever it was to be made of."""
        return super().__new__(cls)

    def __call__(self, *_: Any) -> "Ignored":
        """In place of a function that was found by its name."""
        return self

    def __setstate__(self, state: Any) -> None:
        """Not kept."""

    def __setitem__(self, key: Any, value: Any) -> None:
        """Not kept."""

    def append(self, value: Any) -> None:
        """Not kept."""

    def extend(self, values: Any) -> None:
        """Not kept."""


REBUILDS = {
    "_rebuild_tensor_v2": torch._utils._rebuild_tensor_v2,
    "_rebuild_parameter": torch._utils._rebuild_parameter,
}


class TensorsOnly(pickle.Unpickler):
    """Makes tensors and the containers that they lie in."""

    def find_class(self, module: str, name: str) -> Any:
        """A class that is known to be harmless, or `Ignored`."""
        if (module, name) == ("collections", "OrderedDict"):
            return OrderedDict
        if module == "torch._utils" and name in REBUILDS:
            return REBUILDS[name]
        if module == "torch" and (name.endswith("Storage") or isinstance(getattr(torch, name, None), torch.dtype)):
            return getattr(torch, name)
        return Ignored


def read_tensors(path: Path) -> dict[str, Any]:
    """What a checkpoint has, on the CPU, read as it is used."""
    with path.open("rb") as file:
        if file.read(len(POINTER)) == POINTER:
            raise ReleaseError(
                f"{path} is a pointer of Git LFS, not the file: in the checkout, run "
                'git lfs pull --include="motionbricks/out/**" --exclude=""'
            )
    reader = ModuleType("tensors_only")
    vars(reader).update(Unpickler=TensorsOnly, load=pickle.load)
    try:
        content = torch.load(path, map_location="cpu", mmap=True, weights_only=False, pickle_module=reader)
    except (RuntimeError, pickle.UnpicklingError, EOFError) as error:
        raise ReleaseError(f"{path} is no checkpoint of PyTorch: {error}") from error
    return content if isinstance(content, dict) else {"": content}


def read_state(path: Path) -> dict[str, Tensor]:
    """The weights of a checkpoint by name."""
    state = read_tensors(path).get("state_dict")
    if not isinstance(state, dict):
        raise ReleaseError(f"{path} has no state_dict")
    return {name: value for name, value in state.items() if isinstance(value, Tensor)}
