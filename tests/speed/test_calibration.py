"""A fixed workload, whose time says how fast the machine is; ratios between runs are divided by its own.

It is timed at the start, in the middle and at the end of a run (``conftest.py`` sees to that). It has nothing in
common with the code of the project, so that no change there can touch it. Where the three medians differ by more than
``DRIFT``, the run warns that the machine is noisy, and ``extra_info`` of the last one says so.
"""

import ast
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import njit

DRIFT = 0.1
"""Largest difference of the medians of a quiet machine, relative to the shortest."""

MEDIANS: dict[str, float] = {}
"""Median time [s] of each moment of this run."""


def noise_in(medians: dict[str, float]) -> dict[str, float | str]:
    """Return what a run notes of the drift between its moments, and warn where it is large."""
    drift = max(medians.values()) / min(medians.values()) - 1.0
    if drift <= DRIFT:
        return {"drift": drift}
    warnings.warn(
        f"the machine is noisy: its calibrations differ by {drift:.0%}; repeat the run without other programs",
        stacklevel=2,
    )
    return {"drift": drift, "machine": "noisy"}


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

    def workload() -> float:
        total = _gather(values, places)
        for _ in range(20):
            np.einsum("ij,jk->ik", matrix, matrix)
        for vector in vectors:
            np.sqrt((vector**2).sum())
        return float(total)

    once = workload()
    assert benchmark.pedantic(workload, rounds=600, warmup_rounds=20) == once
    MEDIANS[moment] = benchmark.stats.stats.median
    if moment == "end":
        benchmark.extra_info.update(noise_in(MEDIANS))


def test_the_workload_uses_nothing_of_the_project() -> None:
    tree = ast.parse(Path(__file__).read_text(encoding="utf-8"))
    modules = [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    modules += [name.name for node in ast.walk(tree) if isinstance(node, ast.Import) for name in node.names]
    assert "numba" in modules
    assert {module for module in modules if module.startswith(("proxbench", "contestants", "known_solvers"))} == set()


def test_calibrations_that_agree_are_noted_without_a_warning() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert noise_in({"start": 1.0, "middle": 1.02, "end": 1.05}) == {"drift": pytest.approx(0.05)}


def test_calibrations_that_differ_are_noted_as_noise_with_a_warning() -> None:
    with pytest.warns(UserWarning, match="the machine is noisy: its calibrations differ by 50%"):
        assert noise_in({"start": 1.0, "middle": 1.5, "end": 1.2})["machine"] == "noisy"
