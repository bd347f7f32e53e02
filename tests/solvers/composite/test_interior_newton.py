"""InteriorNewton: each method goes on from what the others have found."""

import math

import numpy as np
import pytest
from proxbench.problems import judge, load
from proxbench.solvers import Status, Stop, create, solve


@pytest.mark.parametrize("name", ["hard-duplicated-slider-mu10", "hard-scaled-tower-10", "hard-remote-brakes-3"])
def test_it_solves_what_interior_points_alone_leave_unsolved(name: str) -> None:
    """Rounding and answers that are not strictly complementary keep an interior point from these digits."""
    problem = load(name)
    alone = solve(problem, "InteriorPoint", tolerance=1e-9, max_iterations=300)
    together = solve(problem, "InteriorNewton", tolerance=1e-9)
    assert alone.status is not Status.SOLVED
    assert together.status is Status.SOLVED
    assert judge(problem, together.impulses).residual <= 1e-9


def test_iterations_are_counted_through_all_methods_and_each_is_shown() -> None:
    problem = load("hard-duplicated-slider-mu10")
    seen: list[int] = []
    solution = (
        create("InteriorNewton").prepare(problem).solve(Stop(1e-9), observe=lambda iteration, _: seen.append(iteration))
    )
    assert seen == list(range(1, solution.iterations + 1))
    assert "InteriorPoint" in solution.message
    assert "SemismoothNewton: solved" in solution.message


def test_an_iteration_limit_holds_for_all_methods_together() -> None:
    problem = load("hard-duplicated-slider-mu10")
    solution = create("InteriorNewton").prepare(problem).solve(Stop(1e-14, max_iterations=150))
    assert solution.iterations <= 150


def test_the_best_impulses_of_all_methods_are_returned() -> None:
    problem = load("pile-100")
    solution = create("InteriorNewton").prepare(problem).solve(Stop(1e-15, max_iterations=20, max_seconds=math.inf))
    alone = create("InteriorPoint").prepare(problem).solve(Stop(1e-15, max_iterations=20, max_seconds=math.inf))
    assert np.array_equal(solution.impulses, alone.impulses)
