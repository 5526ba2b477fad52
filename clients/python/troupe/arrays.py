"""Arrays as the library takes and gives them."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from troupe.errors import InvalidArgumentError

F32: TypeAlias = npt.NDArray[np.float32]
F64: TypeAlias = npt.NDArray[np.float64]
Bools: TypeAlias = npt.NDArray[np.bool_]
Ints: TypeAlias = npt.NDArray[np.int64]


def floats(field: str, values: npt.ArrayLike, shape: tuple[int | None, ...]) -> F32:
    """The values as 32-bit floats of a shape, in which None stands for any length.

    Raises:
        InvalidArgumentError: They are not numbers, not finite, or of another shape.

    """
    allowed = "(" + ", ".join("any" if length is None else str(length) for length in shape) + ")"
    try:
        array = np.asarray(values, np.float32)
    except (TypeError, ValueError) as error:
        raise InvalidArgumentError(f"{field}: {error}", field=field, allowed=f"numbers of shape {allowed}") from error
    fits = array.ndim == len(shape) and all(
        wanted in (None, got) for wanted, got in zip(shape, array.shape, strict=True)
    )
    if not fits:
        message = f"{field}: has shape {array.shape}; allowed: {allowed}"
        raise InvalidArgumentError(message, field=field, allowed=allowed)
    if not np.isfinite(array).all():
        raise InvalidArgumentError(f"{field}: not all numbers are finite", field=field, allowed="finite numbers")
    return array
