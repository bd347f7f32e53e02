"""Operations on arrays in kernels."""

from numba import njit


@njit(cache=True, error_model="numpy")
def copy_entries(source, target):  # type: ignore[no-untyped-def]
    """Copy the entries of a vector to another one of the same length.

    The assignment ``target[:] = source`` takes three seconds longer to compile, because it contains the text of an
    error message.
    """
    for k in range(len(target)):
        target[k] = source[k]
