"""CentralPath follows one curve through its turns to a solution that agrees with other methods."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, judge, load
from proxbench.solvers import SolverError, Status, Stop, create, solve
from proxbench.solvers.interior.central_path import CentralPath, ResumablePath
from proxbench.solvers.interior.power_series import Direction, Series
from proxbench.solvers.interior.runs import SingleRun


@pytest.mark.parametrize("name", ["hard-supports-32", "hard-tresca-joint", "hard-mixed-laws", "funnel-planar-30"])
def test_it_solves_problems_of_every_law(name: str) -> None:
    problem = load(name)
    solution = solve(problem, "CentralPath", tolerance=1e-7)
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1e-7


def test_a_path_that_turns_back_is_followed_to_the_solution() -> None:
    """The path of pile-100 turns back twice."""
    problem = load("pile-100")
    followed = solve(problem, "CentralPath", tolerance=1e-8, max_iterations=400)
    assert followed.status is Status.SOLVED
    assert judge(problem, followed.impulses).residual <= 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("length", [10, 20, 40])
def test_a_resumed_path_is_the_same_path(length: int) -> None:
    """The path of pile-100 has two turns; a resumed path must not start from the beginning."""
    problem = load("pile-100")
    whole = SingleRun(CentralPath()).prepare(problem).solve(Stop(1e-8))
    path, zeros, iterations = ResumablePath(CentralPath(), problem), np.zeros(problem.n_rows), 0
    while not path.has_ended:
        part = path.solve(Stop(1e-8, length), zeros)
        iterations += part.iterations
        assert part.iterations <= length
        assert iterations <= 1.1 * whole.iterations
    assert part.status is whole.status is Status.SOLVED
    assert judge(problem, part.impulses).residual <= 1e-8


def test_the_central_path_of_an_infeasible_problem_is_marked_as_ended() -> None:
    problem = ContactProblem.from_delassus([[0.0]], [-1.0], dim=1)
    path = ResumablePath(CentralPath(), problem)
    assert path.solve(Stop(1e-8)).status is Status.INFEASIBLE
    assert path.has_ended


@pytest.mark.weekly
def test_the_path_never_reverses() -> None:
    """If the direction were chosen by the angle to the last tangent, the path of this pile would reverse at 1e-6."""
    problem = load("pile-400-mixed-2")
    solution = solve(problem, "CentralPath", tolerance=1e-7, max_iterations=600, max_seconds=120.0)
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1e-7


def test_velocities_agree_with_those_of_sweeps() -> None:
    problem = load("funnel-30")
    followed, swept = (solve(problem, solver, tolerance=1e-10) for solver in ("CentralPath", "NSGS"))
    assert followed.status is swept.status is Status.SOLVED
    difference = problem.relative_velocity(followed.impulses) - problem.relative_velocity(swept.impulses)
    assert np.abs(difference).max() <= 1e-8 * np.abs(problem.free_velocity).max()


def test_series_evaluates_to_its_polynomial() -> None:
    random = np.random.default_rng(0)
    r, u, s = random.normal(size=(2, 3)), random.normal(size=(2, 3)), random.normal(size=2)
    series = Series(2, r, u, s)
    first, second = (Direction(k * r, -k * u, k * s, float(k)) for k in (1, 2))
    series.put(1, first)
    series.put(2, second)
    assert series.tau_at(0.5) == pytest.approx(1.0 + 0.5 + 2.0 * 0.25)
    expected = (r - u) + 0.5 * (r + u) + 0.25 * 2.0 * (r + u)
    assert np.abs(series.manifold_vector(0.5) - expected).max() <= 1e-14


def test_friction_bounded_by_another_contact_is_declined_with_the_reason() -> None:
    reason = create("CentralPath").supports(load("hard-remote-partner"))
    assert reason is not None
    assert "bounded by the unilateral law of another contact" in reason


@pytest.mark.parametrize("order", [1, 2.5, 51])
def test_an_order_out_of_range_is_refused(order: float) -> None:
    with pytest.raises(SolverError, match="order must be a whole number"):
        create("CentralPath", order=order)
