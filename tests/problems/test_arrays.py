"""Copies of arrays keep every number, or the error names the one that would change."""

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.arrays import frozen


@pytest.mark.parametrize("value", [256, -129, 0.7, np.nan, np.inf])
def test_a_number_that_an_integer_type_cannot_hold_is_reported(value: float) -> None:
    with pytest.raises(ProblemError, match=r"kind\[1\] = .* must be a whole number from -128 to 127"):
        frozen([0, value], np.int8, "kind")


def test_whole_numbers_of_any_real_type_become_integers() -> None:
    for values in ([0, 3], [0.0, 3.0], np.array([0, 3], dtype=np.uint64), [False, True]):
        array = frozen(values, np.int8)
        assert array.dtype == np.int8
        assert array.tolist() == np.asarray(values).astype(int).tolist()
