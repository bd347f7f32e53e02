"""CvxpyCoulomb solves the problems that ClarabelCoulomb solves, with any conic or quadratic solver."""

import cvxpy
import numpy as np
import pytest
from proxbench.problems import ContactProblem, Laws, judge, load
from proxbench.solvers import SolverError, Status, Stop, create, solve
from proxbench.solvers.conic import cvxpy_coulomb
from proxbench.solvers.conic.cvxpy_coulomb import CvxpyProgram
from proxbench.solvers.conic.programs import ConicStatus


def test_a_splitting_method_selected_by_name_solves_the_problem() -> None:
    problem = load("funnel-30-early")
    solution = create("CvxpyCoulomb", solver="SCS").prepare(problem).solve(Stop(1e-4, 200))
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1e-4


@pytest.mark.parametrize("name", ["funnel-30-early", "funnel-30", "woodpecker-lower-slip-to-stick"])
def test_the_fixed_point_gives_coulomb_friction(name: str) -> None:
    problem = load(name)
    solution = create("CvxpyCoulomb").prepare(problem).solve(Stop(1e-6, 200))
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1e-6


def test_a_problem_with_only_the_delassus_matrix_is_solved_through_its_eigenvalues() -> None:
    """A unit point mass at rest on the ground, pulled by 5 m/s: it slides with Λ = (1, −0.3, 0)."""
    problem = ContactProblem.from_delassus(np.eye(3), (-1.0, 5.0, 0.0), 0.3)
    assert solve(problem, "CvxpyCoulomb", tolerance=1e-7).impulses == pytest.approx([1.0, -0.3, 0.0], abs=1e-6)


def test_a_fixed_bound_and_a_cone_hold_in_one_problem() -> None:
    """Law 0: a joint with a = 0.2 pushed by 1 m/s; laws 1, 2: a contact that sticks under μ = 0.5."""
    laws = Laws(
        np.array([1, 0, 1]), np.arange(3), np.array([0.0, 0.0, 0.5]), np.array([0.2, 0.0, 0.0]), np.array([-1, -1, 1])
    )
    problem = ContactProblem.from_delassus(np.eye(3), (1.0, -1.0, 0.4), laws=laws)
    assert solve(problem, "CvxpyCoulomb", tolerance=1e-7).impulses == pytest.approx([-0.2, 1.0, -0.4], abs=1e-6)


@pytest.mark.parametrize("solver", ["OSQP", "CLARABEL"])
def test_frictionless_contact_is_a_quadratic_program(solver: str) -> None:
    problem = load("funnel-frictionless-100")
    solution = create("CvxpyCoulomb", solver=solver).prepare(problem).solve(Stop(1e-6))
    swept = create("SORprox", relaxation=1.3).prepare(problem).solve(Stop(1e-11, 100_000))
    assert solution.status is Status.SOLVED
    assert solution.iterations <= 2
    assert swept.status is Status.SOLVED
    difference = problem.relative_velocity(solution.impulses) - problem.relative_velocity(swept.impulses)
    assert np.abs(difference).max() <= 1e-4 * float(np.abs(problem.free_velocity).max())


@pytest.mark.parametrize("name", ["hard-counterexample", "woodpecker-beak-impact", "hard-sliding-block"])
def test_planar_coulomb_friction_is_a_fixed_point_over_quadratic_programs(name: str) -> None:
    """The wedge |Λ_T| ≤ μ Λ_N is a set of linear inequalities."""
    problem = load(name)
    solution = create("CvxpyCoulomb", solver="OSQP").prepare(problem).solve(Stop(1e-6, 100, 60.0))
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1e-6


def test_a_quadratic_solver_declines_spatial_friction_with_the_reason() -> None:
    reason = create("CvxpyCoulomb", solver="OSQP").supports(load("funnel-30-early"))
    assert reason == "it has spatial friction, and OSQP does not support second-order cones"


def test_the_message_about_an_unknown_solver_names_the_installed_ones() -> None:
    with pytest.raises(SolverError, match=r"cvxpy has no solver 'NOSUCH'; use one of .*CLARABEL"):
        create("CvxpyCoulomb", solver="NOSUCH")
    missing = next(one for one in cvxpy.settings.SOLVERS if one not in cvxpy.installed_solvers())
    with pytest.raises(SolverError, match=rf"solver '{missing}' of cvxpy is not installed; .*CLARABEL"):
        create("CvxpyCoulomb", solver=missing)


@pytest.mark.parametrize("fails", ["velocity", "solver"])
def test_a_run_that_fails_returns_no_impulses_of_the_run_before(fails: str, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = ContactProblem.from_delassus(np.eye(3), (-1.0, 5.0, 0.0), 0.3)
    program, velocity = CvxpyProgram(problem, "CLARABEL"), problem.free_velocity
    assert program.run(velocity, 1e-8, 100, 10.0).status is ConicStatus.CONVERGED
    if fails == "velocity":
        velocity = np.full(3, np.nan)
    else:

        def fail(*_: object, **__: object) -> None:
            raise cvxpy.error.SolverError("failed")

        monkeypatch.setattr(cvxpy.Problem, "solve", fail)
    result = program.run(velocity, 1e-8, 100, 10.0)
    assert result.status is ConicStatus.GAVE_UP
    assert np.isnan(result.impulses).all()
    assert result.iterations == 1


def test_an_option_that_the_solver_does_not_know_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = ContactProblem.from_delassus(np.eye(3), (-1.0, 5.0, 0.0), 0.3)
    names = cvxpy_coulomb._OptionNames(iteration_limit="no_such_option")
    monkeypatch.setitem(cvxpy_coulomb._OPTION_NAMES, "CLARABEL", names)
    with pytest.raises(Exception, match="no_such_option"):
        CvxpyProgram(problem, "CLARABEL").run(problem.free_velocity, 1e-8, 100, 10.0)
