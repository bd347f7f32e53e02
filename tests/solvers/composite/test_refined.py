"""Refined reaches residuals that a fixed point over cone programs alone does not."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, judge, load
from proxbench.problems.contact.residual import Residual
from proxbench.solvers import SolverError, Status, Stop, create, solve
from proxbench.solvers.composite.refined import Refined, Refinement
from proxbench.solvers.iteration.stopping import Clock


def test_it_reaches_residuals_that_an_interior_point_method_cannot() -> None:
    problem = load("hard-incline-mu1-critical")
    plain = solve(problem, "ClarabelCoulomb", tolerance=1e-12)
    refined = solve(problem, "Refined(ClarabelCoulomb)", tolerance=1e-12)
    assert plain.status is Status.STALLED
    assert refined.status is Status.SOLVED
    assert judge(problem, refined.impulses).residual <= 1e-12


def test_it_needs_fewer_cone_programs() -> None:
    problem = load("funnel-100")
    plain, refined = (solve(problem, name, tolerance=1e-6) for name in ("ClarabelCoulomb", "Refined(ClarabelCoulomb)"))
    assert plain.status is refined.status is Status.SOLVED
    assert refined.iterations < plain.iterations


@pytest.mark.parametrize("name", ["ClarabelCoulomb", "CvxpyCoulomb"])
def test_iterates_are_those_of_the_solver_until_a_refinement_lowers_the_residual(name: str) -> None:
    problem, histories = load("funnel-30"), []
    for solver in (name, f"Refined({name})"):
        seen: list[np.ndarray] = []
        create(solver).prepare(problem).solve(Stop(1e-12, 8), observe=lambda _, x, seen=seen: seen.append(x.copy()))
        histories.append(seen)
    pairs = zip(*histories, strict=False)
    plain, refined = next(pair for pair in pairs if not np.array_equal(*pair))
    assert np.array_equal(histories[0][0], histories[1][0])
    assert judge(problem, refined).residual < judge(problem, plain).residual


@pytest.mark.parametrize("scale", [1e-6, 1e-3])
def test_impulses_with_the_states_of_the_solution_are_corrected_to_rounding(scale: float) -> None:
    """A block pressed down by 1 m/s and pulled by 5 m/s slides with Λ = (1, −μ, 0); any start near it is corrected."""
    problem = ContactProblem.from_factors(np.eye(3), np.ones(3), (-1.0, 5.0, 0.0), 0.3)
    residual = Residual(problem)
    near = np.array([1.0, -0.3, 0.0]) * (1.0 + scale)
    refinement = Refinement(problem, residual, Clock(60.0), 1e-14)
    first = residual(near, problem.relative_velocity(near))
    assert np.array_equal(refinement.correct(near, first, False)[0], near)  # the first iterate of a phase is unchanged
    corrected, reached = refinement.correct(near, first, False)
    assert corrected == pytest.approx([1.0, -0.3, 0.0], abs=1e-14)
    assert reached <= 1e-14


def test_its_name_contains_the_solver_with_its_options() -> None:
    assert create("Refined(ClarabelCoulomb(memory=0))").name == "Refined(ClarabelCoulomb(memory=0))"


def test_a_solver_that_offers_no_iterates_is_refused() -> None:
    with pytest.raises(SolverError, match="cannot refine SORprox, which does not offer its iterates"):
        create("Refined(SORprox)")


def test_a_part_that_is_no_solver_is_refused() -> None:
    with pytest.raises(SolverError, match="cannot refine 'ClarabelCoulomb', which does not offer its iterates"):
        Refined("ClarabelCoulomb")  # type: ignore[arg-type]
