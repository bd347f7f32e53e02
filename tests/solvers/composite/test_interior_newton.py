"""InteriorNewton: each method continues from the results of the others."""

import math

import numpy as np
import pytest
from proxbench.bench.simulation.generation.body_problems import body_problem
from proxbench.problems import ContactProblem, judge, load
from proxbench.solvers import Status, Stop, create, solve
from proxbench.solvers.composite.interior_newton import cone_programs, first_method, form_for


@pytest.mark.parametrize("name", ["hard-duplicated-slider-mu10", "hard-scaled-tower-10", "hard-linked-redundant"])
def test_it_solves_problems_that_interior_points_alone_do_not(name: str) -> None:
    """Rounding, or a lack of strict complementarity, prevents interior points from reaching these digits."""
    problem = load(name)
    alone = solve(problem, "InteriorPoint", tolerance=1e-9, max_iterations=300)
    together = solve(problem, "InteriorNewton", tolerance=1e-9)
    assert alone.status is not Status.SOLVED
    assert together.status is Status.SOLVED
    assert judge(problem, together.impulses).residual <= 1e-9


@pytest.mark.slow
def test_newtons_method_from_zero_solves_an_impact_that_no_other_method_solves() -> None:
    problem = body_problem("bodies-wall-struck")
    solution = solve(problem, tolerance=1e-8, max_iterations=10**6)
    assert solution.status is Status.SOLVED
    assert solution.message.endswith("HybridNewton: iteration limit; SemismoothNewton: solved")
    assert judge(problem, solution.impulses).residual <= 1e-8


def test_iterations_of_all_methods_are_consecutive_and_observed() -> None:
    problem = load("hard-duplicated-slider-mu10")
    seen: list[int] = []
    solution = (
        create("InteriorNewton").prepare(problem).solve(Stop(1e-9), observe=lambda iteration, _: seen.append(iteration))
    )
    assert seen == list(range(1, solution.iterations + 1))
    assert "InteriorPoint" in solution.message
    assert solution.message.endswith("NesterovSORprox: solved")


def test_an_iteration_limit_holds_for_all_methods_together() -> None:
    problem = load("hard-duplicated-slider-mu10")
    solution = create("InteriorNewton").prepare(problem).solve(Stop(1e-14, max_iterations=150))
    assert solution.iterations <= 150


def test_the_best_impulses_of_all_methods_are_returned() -> None:
    problem = load("pile-100")
    solution = create("InteriorNewton").prepare(problem).solve(Stop(1e-15, max_iterations=20, max_seconds=math.inf))
    alone = create("InteriorPoint").prepare(problem).solve(Stop(1e-15, max_iterations=20, max_seconds=math.inf))
    assert np.array_equal(solution.impulses, alone.impulses)


def boxes_on_a_slope(per_pair: int, n_boxes: int) -> ContactProblem:
    """Return a problem of stacked boxes with ``per_pair`` contact points per pair, with factors."""
    rng = np.random.default_rng(2)
    columns = []
    for box in range(n_boxes):
        for point in rng.uniform(-0.5, 0.5, (per_pair, 3)):
            for axis in (2, 0, 1):  # the normal is the third one
                direction = np.zeros(6 * n_boxes)
                direction[6 * box + axis] = 1.0
                direction[6 * box + 3 : 6 * box + 6] = np.cross(point, np.eye(3)[axis])
                if box:
                    direction[6 * box - 6 : 6 * box] = -direction[6 * box : 6 * box + 6]
                columns.append(direction)
    directions = np.array(columns).T
    gravity = np.tile([0.01, 0.0, -0.05, 0.0, 0.0, 0.0], n_boxes)
    return ContactProblem.from_factors(directions, np.ones(6 * n_boxes), directions.T @ gravity, 0.5, dim=3)


@pytest.mark.parametrize(("per_pair", "form"), [(2, "delassus"), (4, "delassus"), (5, "factors"), (16, "factors")])
def test_it_factorises_over_bodies_if_contacts_of_a_pair_are_redundant(per_pair: int, form: str) -> None:
    """A pair has six degrees of freedom: 6 rows do not overdetermine it, 12 are twice as many, 15 even more."""
    problem = boxes_on_a_slope(per_pair, 4)
    assert form_for(problem) == form
    assert solve(problem, "InteriorNewton", tolerance=1e-9).status is Status.SOLVED
    bare = ContactProblem.from_delassus(problem.delassus(), problem.free_velocity, 0.5, dim=3)
    assert form_for(bare) == "delassus"


def test_it_factorises_over_contacts_if_pairs_touch_once() -> None:
    """Balls with rolling resistance have five rows per contact."""
    problem = load("pile-100-rolling")
    assert problem.factors is not None
    assert problem.n_rows > 2 * problem.factors.n_dofs
    assert form_for(problem) == "delassus"


@pytest.mark.parametrize(("name", "is_cheap"), [("bodies-stack-10", True), ("pile-400-mixed-1", False)])
def test_cone_programs_are_tried_where_one_takes_the_work_of_a_few_steps(name: str, is_cheap: bool) -> None:
    """A cone program is cheap on a stack; on a pile of balls, its operations grow faster than the work of a step."""
    problem = load(name)
    operations = first_method(problem).prepare(problem).system.flops
    assert (cone_programs(problem, operations) is not None) is is_cheap
    assert cone_programs(problem, 1e15) is None
    assert cone_programs(problem, 0.0) is not None
