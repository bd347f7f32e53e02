"""Operations on arrays in kernels that save time of compilation."""

from typing import Any

import numpy as np
from numba import njit
from numba.core import types
from numba.core.imputils import impl_ret_borrowed
from numba.extending import intrinsic, overload


def as_read_only(array: "np.ndarray[Any, Any]") -> "np.ndarray[Any, Any]":
    """Return the array itself; in a kernel, its type says that it is not written to.

    Numba compiles a kernel separately for arrays that may be written to and for those that may not.
    """
    return array


@intrinsic
def _cast(typing_context: Any, array: Any) -> Any:
    constant = array.copy(readonly=True)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return impl_ret_borrowed(context, builder, signature.return_type, arguments[0])  # type: ignore[no-untyped-call]

    return constant(array), generate


@overload(as_read_only)
def _as_read_only(array):  # type: ignore[no-untyped-def]
    if not isinstance(array, types.Array):
        return None
    return lambda array: _cast(array)  # type: ignore[call-arg]


@njit(cache=True, error_model="numpy")
def copy_entries(source, target):  # type: ignore[no-untyped-def]
    """Copy the entries of a vector to another one of the same length.

    The assignment ``target[:] = source`` takes three seconds longer to compile, because it contains the text of an
    error message.
    """
    for k in range(len(target)):
        target[k] = source[k]
