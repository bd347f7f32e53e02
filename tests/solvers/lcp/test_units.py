"""Lemke's path does not depend on units: ties are relative to the problem's own numbers."""

import pytest
from proxbench.problems.contact.transformations import in_units
from proxbench.problems.hard import hard_case
from proxbench.solvers import Stop, create


@pytest.mark.parametrize("name", ["hard-random-rank", "hard-float32", "hard-mixed-laws", "hard-resting-block-mu10"])
@pytest.mark.parametrize("exponents", [(-20, -20, 0), (10, 0, 7), (0, 30, 0), (-30, 10, -5)])
def test_exact_changes_of_units_change_no_pivot(name: str, exponents: tuple[int, int, int]) -> None:
    problem, stop = hard_case(name), Stop(1e-6, max_iterations=2000, max_seconds=60.0)
    mass, length, time = (2.0**exponent for exponent in exponents)
    other = in_units(problem, mass=mass, length=length, time=time)
    plain, scaled = (create("Lemke").prepare(p).solve(stop) for p in (problem, other.problem))
    assert (scaled.status, scaled.iterations) == (plain.status, plain.iterations)
