"""Array types and read-only copies."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import ProblemError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def real_numbers(values: ArrayLike, name: str) -> NDArray[Any]:
    """Return ``values`` as an array of real numbers of any type.

    Raises:
        ProblemError: if they are complex numbers, strings or other objects.
    """
    try:
        array = np.asarray(values)
    except (TypeError, ValueError):
        raise ProblemError(f"{name} must be an array of real numbers, got {type(values).__name__}.") from None
    if array.dtype.kind not in "fiub":
        raise ProblemError(f"{name} must be an array of real numbers, got an array of {array.dtype}.")
    return array


def frozen(values: ArrayLike, dtype: Any, name: str = "values") -> NDArray[Any]:
    """Return a contiguous read-only copy of ``values``.

    Raises:
        ProblemError: if they are not real numbers.
    """
    array = np.array(real_numbers(values, name), dtype=dtype, order="C", copy=True)
    read_only(array)
    return array


def read_only(*arrays: NDArray[Any]) -> None:
    """Make arrays read-only."""
    for array in arrays:
        array.setflags(write=False)
