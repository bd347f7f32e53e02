"""Operations on arrays in kernels."""

from typing import Any

import numpy as np
from numba import njit, typeof
from proxbench.problems.compilation.kernel_arrays import as_read_only, copy_entries


@njit
def _double(array: Any) -> Any:
    return 2.0 * array


@njit
def _pass_on(array: Any) -> Any:
    return _double(as_read_only(array))


def test_a_read_only_array_of_a_kernel_needs_no_second_compilation() -> None:
    constant = np.arange(3.0)
    constant.setflags(write=False)
    assert np.array_equal(_double(constant), _pass_on(np.arange(3.0)))
    assert [signature[0] for signature in _double.signatures] == [typeof(constant)]


def test_outside_kernels_a_read_only_array_is_the_array_itself() -> None:
    array = np.arange(3.0)
    assert as_read_only(array) is array


def test_copied_entries_replace_those_of_the_target_alone() -> None:
    source, target = np.arange(3.0), np.zeros(5)
    copy_entries(source, target[1:4])
    assert target.tolist() == [0.0, 0.0, 1.0, 2.0, 0.0]
    assert source.tolist() == [0.0, 1.0, 2.0]
