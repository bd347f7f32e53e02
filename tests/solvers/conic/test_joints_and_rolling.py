"""Cone programs have no constraint on joints, and two second-order cones for a contact that resists rolling."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, Laws, Model, judge
from proxbench.problems.contact.projections import onto_cone
from proxbench.problems.contact.transformations import in_units
from proxbench.problems.hard.families import LinkedFamily, random_linked_problem
from proxbench.solvers import Status, Stop, create, solve

CONVEX = ["ClarabelSOCP"]
COULOMB = ["ClarabelCoulomb", "CvxpyCoulomb", "Refined(ClarabelCoulomb)"]
FACTORS = ["ClarabelSOCP(form='factors')", "ClarabelCoulomb(form='factors')"]


def joints(n_rows: int, n_dofs: int) -> ContactProblem:
    rng = np.random.default_rng(n_dofs)
    directions = rng.normal(size=(n_dofs, n_rows))
    free = directions.T @ rng.normal(size=n_dofs)
    return ContactProblem.from_factors(directions, np.ones(n_dofs), free, laws=Laws.joints(n_rows))


@pytest.mark.parametrize("solver", [*CONVEX, *COULOMB, *FACTORS])
def test_impulses_of_joints_alone_solve_a_linear_system(solver: str) -> None:
    problem = joints(4, 9)
    solution = solve(problem, solver, tolerance=1e-8)
    assert solution.status is Status.SOLVED
    expected = np.linalg.solve(problem.delassus().toarray(), -problem.free_velocity)
    assert solution.impulses == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("solver", [*CONVEX, *COULOMB, *FACTORS])
def test_redundant_joints_stay_at_rest(solver: str) -> None:
    problem = joints(6, 4)
    solution = solve(problem, solver, tolerance=1e-8)
    assert solution.status is Status.SOLVED
    assert np.abs(problem.relative_velocity(solution.impulses)).max() <= 1e-7


@pytest.mark.parametrize("length", [1.0, 1e3])
@pytest.mark.parametrize("solver", CONVEX)
def test_the_convex_model_of_a_rolling_contact_is_the_nearest_point_of_both_cones(solver: str, length: float) -> None:
    rng = np.random.default_rng(5)
    laws = Laws.contacts(np.array([0.5]), 3, 1).with_rolling(0.25, 2)
    for _ in range(5):
        c = rng.normal(size=5) - [2.0, 0.0, 0.0, 0.0, 0.0]
        parts, none = (-c[None, 1:3], -c[None, 3:]), (np.zeros(1), np.zeros(1))
        normal, others = onto_cone(-c[:1], parts, (np.array([0.5]), np.array([0.25])), none)
        other = in_units(ContactProblem.from_delassus(np.eye(5), c, laws=laws), length=length)
        solution = solve(other.problem, solver, tolerance=1e-8)
        assert solution.status is Status.SOLVED
        expected = np.concatenate([normal, *(part.ravel() for part in others)])
        assert other.impulses(solution.impulses) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("solver", COULOMB)
def test_a_contact_that_slides_and_rolls_obeys_coulomb_and_not_the_convex_model(solver: str) -> None:
    """G = I: Λ_N = 2, sliding at 3 m/s less μ Λ_N, rolling at 1 rad/s less μ_r Λ_N."""
    laws = Laws.contacts(np.array([0.5]), 2, 1).with_rolling(0.25, 1)
    problem = ContactProblem.from_delassus(np.eye(3), (-2.0, 3.0, 1.0), laws=laws)
    solution = solve(problem, solver, tolerance=1e-8)
    assert solution.impulses == pytest.approx([2.0, -1.0, -0.5], abs=1e-7)
    assert judge(problem, solution.impulses, Model.CONVEX).residual > 0.1


def test_the_dual_of_rolling_friction_is_declined_with_the_reason() -> None:
    problem = random_linked_problem(LinkedFamily(2, 3, rolling_rows=2), 0)
    for solver in FACTORS:
        assert "rolling friction" in str(create(solver).supports(problem))


@pytest.mark.parametrize("seed", range(4))
def test_contacts_and_joints_have_the_same_velocity_in_both_forms(seed: int) -> None:
    family = LinkedFamily(3, 3, 25, friction=0.125, states=("stick", "open"), n_joints=3, rolling_rows=0)
    problem = random_linked_problem(family, seed)
    found = [create(name).prepare(problem).solve(Stop(1e-8)) for name in ("ClarabelSOCP", FACTORS[0])]
    velocities = [problem.relative_velocity(solution.impulses) for solution in found]
    assert [judge(problem, solution.impulses, Model.CONVEX).residual <= 1e-8 for solution in found] == [True, True]
    assert velocities[0] == pytest.approx(velocities[1], abs=1e-4 * np.abs(problem.free_velocity).max())
