"""The outer iteration reports the true status for any result of the conic solver."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from proxbench.problems import ContactProblem, judge, load
from proxbench.problems.contact.residual import Residual
from proxbench.problems.hard.families import Family, random_problem
from proxbench.solvers import Status, Stop, create
from proxbench.solvers.conic.clarabel_coulomb import ClarabelCoulomb
from proxbench.solvers.conic.fixed_point import FastFixedPoint, PreparedFixedPoint
from proxbench.solvers.conic.programs import ClarabelProgram, ConicResult, ConicStatus, Form

PROBLEM = load("hard-counterexample")


class EndsWith:
    """A conic solver that always returns the same impulses and status."""

    def __init__(self, ended: ConicStatus, impulse: float) -> None:
        self.result = ConicResult(np.full(PROBLEM.n_rows, impulse), 1, 0.0, ended)

    def regularised(self, weight: np.ndarray) -> "EndsWith":
        return self

    def run(self, velocity: np.ndarray, accuracy: float, max_iterations: int, max_seconds: float) -> ConicResult:
        return self.result


@pytest.mark.parametrize("impulse", [0.01, np.nan], ids=["finite", "nothing"])
@pytest.mark.parametrize(
    ("ended", "status"), [(ConicStatus.TIME_LIMIT, Status.TIME_LIMIT), (ConicStatus.GAVE_UP, Status.STALLED)], ids=str
)
def test_a_time_limit_of_the_conic_solver_is_not_a_stall(ended: ConicStatus, status: Status, impulse: float) -> None:
    prepared = PreparedFixedPoint(PROBLEM, Residual(PROBLEM), EndsWith(ended, impulse), memory=5)
    solution = prepared.solve(Stop(1e-8, 1000, 60.0))
    assert solution.status is status
    assert np.isfinite(solution.impulses).all()


class Wanders(EndsWith):
    """A conic solver that returns different wrong impulses every time."""

    def run(self, *arguments: object, **options: object) -> ConicResult:
        self.result = replace(self.result, impulses=self.result.impulses + 1.0)
        return self.result


def test_changing_impulses_are_not_a_stall() -> None:
    program = Wanders(ConicStatus.CONVERGED, 1.0)
    prepared = PreparedFixedPoint(PROBLEM, Residual(PROBLEM), program, memory=5)
    solution = prepared.solve(Stop(1e-8, 1000, 60.0))
    assert solution.status is Status.ITERATION_LIMIT
    assert solution.iterations == 1000


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Refined(ClarabelCoulomb)", "Refined(CvxpyCoulomb)", "ClarabelCoulomb"])
def test_the_iteration_limit_does_not_change_the_cone_programs(name: str) -> None:
    """The first iterates do not depend on the iteration limit."""
    prepared = create(name).prepare(load("funnel-30-early"))
    few: list[np.ndarray] = []
    many: list[np.ndarray] = []
    prepared.solve(Stop(1e-8, 2, 60.0), observe=lambda iteration, impulses: few.append(impulses))
    prepared.solve(Stop(1e-8, 1000, 60.0), observe=lambda iteration, impulses: many.append(impulses))
    assert len(few) == 2
    assert np.array_equal(few, many[:2])


NO_CONVEX_SOLUTION = random_problem(
    Family(n_contacts=5, dim=2, n_dofs=4, mass_exponent=0, density=0.6, friction=0.5, states=("slip",)), 1130
)
"""This problem has a Coulomb solution, but its convex model and cone programs near De Saxcé's iterates have none."""


@pytest.mark.parametrize("form", ["delassus", "factors"])
@pytest.mark.parametrize("name", ["ClarabelCoulomb(form={!r})", "Refined(ClarabelCoulomb(form={!r}))"])
def test_proximal_iterations_solve_problems_without_a_first_cone_program(form: Form, name: str) -> None:
    problem = NO_CONVEX_SOLUTION
    first = ClarabelProgram(problem, form).run(problem.free_velocity, 1e-8, 1000, 10.0)
    assert first.status is not ConicStatus.CONVERGED
    solution = create(name.format(form)).prepare(problem).solve(Stop(1e-7))
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1e-7


@pytest.mark.parametrize("form", ["delassus", "factors"])
def test_a_regularised_program_solves_the_problem_with_that_much_more_on_the_diagonal(form: Form) -> None:
    """A block is pulled along the ground, G = 1 + w: Λ_N = 1/(1 + w), and Λ_T is at most μΛ_N."""
    problem = ContactProblem.from_factors(np.eye(3), np.ones(3), (-1.0, 0.1, 0.0), 0.3)
    program = ClarabelProgram(problem, form).regularised(np.full(3, 0.25))
    impulses = program.run(problem.free_velocity, 1e-12, 1000, 10.0).impulses
    assert impulses == pytest.approx([0.8, -0.08, 0.0], abs=1e-6)


@pytest.mark.parametrize("name", ["ClarabelCoulomb", "Refined(ClarabelCoulomb)", "Refined(CvxpyCoulomb)"])
@pytest.mark.parametrize("problem", [NO_CONVEX_SOLUTION, load("funnel-30")], ids=["no convex solution", "funnel"])
def test_a_tighter_tolerance_continues_what_a_looser_one_begins(name: str, problem: ContactProblem) -> None:
    prepared = create(name).prepare(problem)
    iterates: list[list[np.ndarray]] = []
    for tolerance in (1e-2, 1e-5, 1e-9):
        seen: list[np.ndarray] = []
        prepared.solve(Stop(tolerance, 60), observe=lambda iteration, impulses, seen=seen: seen.append(impulses))
        iterates.append(seen)
    for fewer, more in itertools.pairwise(iterates):
        assert 0 < len(fewer) <= len(more)
        assert np.array_equal(fewer[:-1], more[: len(fewer) - 1])  # the last may be refined further


@pytest.mark.parametrize("form", ["delassus", "factors"])
@pytest.mark.parametrize("n_dofs", [6, 60])
def test_one_cone_program_solves_what_can_stay_at_rest(form: Form, n_dofs: int) -> None:
    """c = −GΛ* with Λ* in the cones: ξ = 0 and s = 0, for redundant contacts too."""
    rng = np.random.default_rng(n_dofs)
    directions = rng.normal(size=(n_dofs, 60))
    balanced = np.tile([1.0, 0.2, -0.1], 20) * np.repeat(rng.uniform(0.1, 10.0, 20), 3)
    problem = ContactProblem.from_factors(
        directions, np.ones(n_dofs), -directions.T @ (directions @ balanced), friction=0.5, dim=3
    )
    solution = FastFixedPoint(ClarabelCoulomb(form)).prepare(problem).solve(Stop(1e-6))
    assert (solution.status, solution.iterations) == (Status.SOLVED, 1)
    assert np.abs(problem.relative_velocity(solution.impulses)).max() <= 1e-6 * np.abs(problem.free_velocity).max()


def test_a_fast_fixed_point_ends_at_the_first_program_that_gains_less_than_a_digit() -> None:
    problem, seen = load("pile-100"), [1.0]
    residual = Residual(problem)
    solution = (
        FastFixedPoint(ClarabelCoulomb())
        .prepare(problem)
        .solve(Stop(1e-12), observe=lambda _, impulses: seen.append(residual.judged(problem, impulses)))
    )
    assert solution.status is Status.STALLED
    gains = [later / min(seen[: number + 1]) for number, later in enumerate(seen[1:])]
    assert max(gains[:-1]) < 0.1 <= gains[-1]
    assert solution.iterations == len(gains) > 1
