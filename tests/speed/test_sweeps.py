"""Sweeps per second of the projected iterations."""

from typing import Any

import numpy as np
import pytest
from contestants import OPTIONS, SIZES, funnel_step
from proxbench.solvers import create
from proxbench.solvers.iteration.loop import PreparedIteration

SWEEPS = 100


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("entry", [*OPTIONS["JORprox"], *OPTIONS["SORprox"]])
def test_hundred_sweeps(benchmark: Any, entry: str, size: int) -> None:
    problem = funnel_step(f"funnel-{size}")
    prepared = create(entry).prepare(problem.fresh())
    assert isinstance(prepared, PreparedIteration)
    iterates = prepared.begin(np.zeros(problem.n_rows))
    iterates.sweep(SWEEPS)
    benchmark.extra_info.update(problem=problem.name, digest=problem.digest)
    benchmark.pedantic(iterates.sweep, args=(SWEEPS,), rounds=100, warmup_rounds=3)
    seconds = benchmark.stats.stats.median
    benchmark.extra_info["sweeps_per_second"] = SWEEPS / seconds
    benchmark.extra_info["nanoseconds_per_contact"] = 1e9 * seconds / SWEEPS / problem.n_contacts
