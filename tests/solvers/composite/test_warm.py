"""Warm is its solver with a name that shows the start."""

import numpy as np
import pytest
from proxbench.problems import load
from proxbench.problems.contact.solver import starts_from_last_answer
from proxbench.solvers import SolverError, Status, Stop, create


def test_it_solves_as_its_solver_does_from_any_start() -> None:
    problem, stop = load("funnel-30"), Stop(1e-6)
    warm, own = create("Warm(SORprox(relaxation=1.5))"), create("SORprox(relaxation=1.5)")
    first = own.prepare(problem).solve(Stop(1e-2))
    for start in (None, first.impulses):
        found, expected = (one.prepare(problem).solve(stop, start) for one in (warm, own))
        assert found.status is Status.SOLVED
        np.testing.assert_array_equal(found.impulses, expected.impulses)


def test_only_warm_declares_that_it_starts_from_its_last_answer() -> None:
    assert starts_from_last_answer(create("Warm(NSGS)"))
    assert not starts_from_last_answer(create("NSGS"))
    assert create("Warm(PyramidPGS(sides=4))").model == create("PyramidPGS(sides=4)").model


@pytest.mark.parametrize("name", ["Fallback(Warm(SORprox), NSGS)", "Warm(Warm(SORprox))"])
def test_a_composite_solver_cannot_contain_a_warm_solver(name: str) -> None:
    with pytest.raises(SolverError, match=r"cannot contain Warm\(SORprox\), whose start a run provides"):
        create(name)
