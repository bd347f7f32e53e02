"""Types of arrays, and read-only ones."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def frozen(values: ArrayLike, dtype: Any) -> NDArray[Any]:
    """Return a contiguous read-only copy of ``values``."""
    array = np.array(values, dtype=dtype, order="C", copy=True)
    read_only(array)
    return array


def read_only(*arrays: NDArray[Any]) -> None:
    """Let nothing be written to ``arrays`` any more."""
    for array in arrays:
        array.setflags(write=False)
