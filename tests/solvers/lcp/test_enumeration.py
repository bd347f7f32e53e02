"""Enumeration finds every solution of tiny planar problems, and reports if there is none."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import ContactProblem, Laws, ProblemError, judge, load, suite
from proxbench.problems.hard import HARD_CASES, hard_case
from proxbench.solvers import Status, Stop, create, solve


@pytest.mark.slow
@settings(max_examples=settings.default.max_examples // 2, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(1, 4), friction=st.floats(0.0, 0.4))
def test_the_solution_of_projected_gauss_seidel_is_enumerated(seed: int, n: int, friction: float) -> None:
    rng = np.random.default_rng(seed)
    problem = ContactProblem.from_factors(
        rng.normal(size=(3 * n, 2 * n)), np.ones(3 * n), rng.normal(size=2 * n), friction, dim=2
    )
    swept = create("SORprox", relaxation=0.5).prepare(problem).solve(Stop(1e-11, 50_000))
    if swept.status is not Status.SOLVED:
        return
    found = create("Enumeration").prepare(problem).all_solutions(1e-9)  # type: ignore[attr-defined]
    assert min(np.abs(swept.impulses - known).max() for known in found) <= 1e-5 * max(1.0, np.abs(swept.impulses).max())


def test_the_woodpecker_agrees_in_velocity_with_projected_gauss_seidel_and_the_conic_fixed_point() -> None:
    for problem in suite("woodpecker"):
        exact = solve(problem, "Enumeration", tolerance=1e-11)
        assert exact.status is Status.SOLVED
        speed = float(np.abs(problem.free_velocity).max())
        for name, tolerance in (("SORprox(relaxation=0.8)", 1e-11), ("ClarabelCoulomb", 1e-8)):
            other = solve(problem, name, tolerance=tolerance, max_iterations=100_000)
            assert other.status is Status.SOLVED
            difference = problem.relative_velocity(other.impulses) - problem.relative_velocity(exact.impulses)
            assert np.abs(difference).max() <= 1e2 * tolerance * speed


@pytest.mark.slow
def test_on_hard_cases_claims_are_true_and_refusals_have_reasons() -> None:
    untrue, unsaid = {}, {}
    for problem in map(hard_case, HARD_CASES):
        if problem.n_rows > 30:
            continue
        solution = solve(problem, "Enumeration", tolerance=1e-10)
        if solution.status is Status.SOLVED:
            residual = judge(problem, solution.impulses).residual
            if not residual <= 1e-10:
                untrue[problem.name] = residual
        elif solution.status is Status.UNSUPPORTED:
            if "spatial" not in solution.message and "contacts" not in solution.message:
                unsaid[problem.name] = solution.message
        elif not solution.message:
            unsaid[problem.name] = solution.status
    assert untrue == {}
    assert unsaid == {}


def test_a_problem_without_a_solution_is_infeasible() -> None:
    """With G = 0, nothing can stop a closing unilateral contact."""
    problem = ContactProblem.from_delassus(np.array([[0.0, 0.0], [0.0, 1.0]]), (-1.0, 0.0), 0.3, dim=2)
    assert solve(problem, "Enumeration").status is Status.INFEASIBLE


def test_a_joint_with_dry_friction_slips_at_its_fixed_bound() -> None:
    laws = Laws(np.array([1, 1]), np.array([0, 1]), np.zeros(2), np.array([0.2, 0.2]), np.array([-1, -1]))
    problem = ContactProblem.from_delassus(np.eye(2), (1.0, 0.1), laws=laws)
    assert solve(problem, "Enumeration", tolerance=1e-12).impulses == pytest.approx([-0.2, -0.1], abs=1e-14)


def test_enumeration_finds_all_three_solutions_of_the_rod() -> None:
    problem = load("hard-three-solutions")
    assert problem.answer is not None
    found = create("Enumeration").prepare(problem).all_solutions(1e-10)  # type: ignore[attr-defined]
    assert len(found) == len(problem.answer.impulses) == 3
    for known in problem.answer.impulses:
        assert min(np.abs(known - impulses).max() for impulses in found) <= 1e-12


def test_a_start_of_the_wrong_shape_is_refused() -> None:
    problem = load("hard-supports-2")
    with pytest.raises(ProblemError, match=r"start must have shape"):
        create("Enumeration").prepare(problem).solve(Stop(1e-6), start=np.zeros(1))


def test_the_iteration_limit_bounds_the_combinations() -> None:
    prepared = create("Enumeration").prepare(load("hard-sliding-block"))
    whole = prepared.solve(Stop(1e-9))
    assert whole.status is Status.SOLVED
    cut = prepared.solve(Stop(1e-9, max_iterations=whole.iterations - 1))
    assert (cut.status, cut.iterations) == (Status.ITERATION_LIMIT, whole.iterations - 1)
