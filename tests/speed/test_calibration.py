"""A fixed workload, whose time says how fast the machine is; ratios between runs are divided by its own.

It is timed at the start, in the middle and at the end of a run (``conftest.py`` sees to that). It has nothing in
common with the code of the project, so that no change there can touch it.
"""

from typing import Any

import numpy as np
import pytest
from numba import njit


@njit(cache=True)
def _gather(values, places):  # type: ignore[no-untyped-def]
    """Add up values in a scattered order, each term waiting for the one before, as a sweep over contacts does."""
    total = 0.0
    for place in places:
        total = 0.5 * total + values[place]
    return total


@pytest.mark.parametrize("moment", ["start", "middle", "end"])
def test_calibration(benchmark: Any, moment: str) -> None:
    random = np.random.default_rng(0)
    values, places = random.normal(size=50_000), random.integers(0, 50_000, size=200_000)
    matrix, vectors = random.normal(size=(60, 60)), random.normal(size=(200, 6))

    def workload() -> None:
        _gather(values, places)
        for _ in range(20):
            np.einsum("ij,jk->ik", matrix, matrix)
        for vector in vectors:
            np.sqrt((vector**2).sum())

    workload()
    benchmark.pedantic(workload, rounds=600, warmup_rounds=20)
