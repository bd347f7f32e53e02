"""Operations on arrays in kernels."""

import numpy as np
from proxbench.problems.compilation.kernel_arrays import copy_entries


def test_copied_entries_replace_those_of_the_target_alone() -> None:
    source, target = np.arange(3.0), np.zeros(5)
    copy_entries(source, target[1:4])
    assert target.tolist() == [0.0, 0.0, 1.0, 2.0, 0.0]
    assert source.tolist() == [0.0, 1.0, 2.0]
