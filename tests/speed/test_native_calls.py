"""Overhead of a call of a solver in another language: a library, and a program through pipes."""

from pathlib import Path
from typing import Any

import native_builds
import numpy as np
import pytest
from proxbench.problems import ContactProblem
from proxbench.solvers import Stop, create

BUILDS = {"Shared": native_builds.faulty_library, "Executable": native_builds.faulty_program}
"""Solvers that return Λ = 0 immediately."""

ROUNDS = 2000


def ten_contacts() -> ContactProblem:
    rng = np.random.default_rng(3)
    return ContactProblem.from_factors(rng.normal(size=(40, 30)), np.ones(40), rng.normal(size=30), 0.3)


@pytest.mark.parametrize("kind", BUILDS)
def test_calling(benchmark: Any, kind: str, tmp_path: Path) -> None:
    prepared = create(f"{kind}({BUILDS[kind](tmp_path)})").prepare(ten_contacts())
    solution = benchmark.pedantic(prepared.solve, args=(Stop(),), rounds=ROUNDS, warmup_rounds=20)
    assert not solution.impulses.any()


@pytest.mark.parametrize("kind", BUILDS)
def test_preparing(benchmark: Any, kind: str, tmp_path: Path) -> None:
    solver, problem = create(f"{kind}({BUILDS[kind](tmp_path)})"), ten_contacts()
    solver.prepare(problem)
    benchmark.pedantic(solver.prepare, setup=lambda: ((problem.fresh(),), {}), rounds=ROUNDS, warmup_rounds=20)
