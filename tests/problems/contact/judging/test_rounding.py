"""Rounding hides no violation: huge impulses that cancel are judged as in exact arithmetic."""

from fractions import Fraction

import numpy as np
import pytest
from exact_residual import exact_residual, exact_velocity
from proxbench.problems import ContactProblem, Laws, Model, judge, load
from proxbench.problems.contact.residual import Residual

WALLS = np.array([[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 1.0]])
"""Force directions of two opposite walls on one disc, normals and tangents."""


def test_a_body_squeezed_by_huge_impulses_is_not_solved() -> None:
    verdict = judge(load("hard-squeezed"), [1e16, 1e16])
    assert verdict.residual == 1.0
    assert verdict.local_residual == verdict.energy_residual == verdict.natural_map_q == 1.0
    assert verdict.component_residuals == (1.0,)


@pytest.mark.parametrize("size", [1e15, 1e17, 1e30, 1e100, 1e150])
@pytest.mark.parametrize("model", [Model.COULOMB, Model.FRICTIONLESS, Model.CONVEX])
def test_walls_that_approach_with_friction_are_not_solved(size: float, model: Model) -> None:
    problem = ContactProblem.from_factors(WALLS, np.ones(2), [-1.0, 0.1, -1.0, 0.1], 0.5, dim=2)
    for tangential in (0.0, 0.5 * size):
        assert judge(problem, [size, tangential, size, -tangential], model).residual >= 0.5


def test_spatial_walls_with_impulses_beyond_the_range_of_squares_are_not_solved() -> None:
    directions = np.array([[1.0, 0, 0, -1.0, 0, 0], [0, 1.0, 0, 0, 1.0, 0], [0, 0, 1.0, 0, 0, 1.0]])
    problem = ContactProblem.from_factors(directions, np.ones(3), [1.0, 0, 0, 1.0, 0, 0], 0.5)
    assert judge(problem, [0.0, 1e200, 1e200, 0.0, -1e200, -1e200]).residual > 1.0


def test_redundant_joints_with_huge_impulses_are_not_solved() -> None:
    problem = ContactProblem.from_factors(np.array([[1.0, -1.0]]), np.ones(1), [-1.0, 0.5], laws=Laws.joints(2))
    verdict = judge(problem, [1e17, 1e17])
    assert verdict.residual == 1.0
    assert verdict.natural_map_q == pytest.approx(1.0)


def test_a_velocity_lost_to_cancellation_is_computed_accurately() -> None:
    """The sum of three terms of up to 10¹⁶ is 1; plain summation gives 0 or 2."""
    problem = ContactProblem.from_delassus(np.full((3, 3), 1.0), [-1.0, -1.0, -1.0], dim=1)
    impulses = [1e16, 1.0, -1e16]
    velocity, rounding = problem.accurate_velocity(impulses)
    assert (velocity == 0.0).all()
    assert 0.0 < rounding.max() < 1e-10


@pytest.mark.parametrize("name", ["hard-scaled-rows", "hard-scaled-tower-10", "hard-stack-10-bottom-1e8"])
def test_correct_solutions_are_certified_although_a_bound_by_norms_is_larger(name: str) -> None:
    problem = load(name)
    assert problem.answer is not None
    impulses, delassus = np.array(problem.answer.impulses)[0], abs(problem.delassus()).toarray()
    scale = np.abs(problem.free_velocity).max()
    product = 2.0**-53 * delassus.sum(axis=1).max() * np.abs(impulses).max() / scale
    assert max(judge(problem, impulses).residual, exact_residual(problem, impulses)) < 1e-10 < 1e-8 < product


@pytest.mark.parametrize("name", ["hard-stack-2-top-1e8", "hard-scaled-rows", "hard-linked-3-axes"])
@pytest.mark.parametrize("size", [1.0, 1e12])
def test_accurate_velocities_are_exact_to_their_bound(name: str, size: float) -> None:
    problem, rng = load(name), np.random.default_rng(0)
    impulses = size * rng.normal(size=problem.n_rows)
    velocity, rounding = problem.accurate_velocity(impulses)
    exact = exact_velocity(problem, impulses)
    for found, hidden, right in zip(velocity, rounding, exact, strict=True):
        assert abs(Fraction(found) - right) <= Fraction(2.0**-53) * abs(right) + Fraction(hidden)


def test_zero_impulses_have_no_rounding_error() -> None:
    problem = ContactProblem.from_delassus(np.eye(3), [1.0, 2.0, -3.0], laws=Laws.contacts(0.5, 3, 1))
    velocity, rounding = problem.accurate_velocity(np.zeros(3))
    assert (rounding == 0.0).all()
    assert (velocity == problem.free_velocity).all()
    assert judge(ContactProblem.from_delassus(np.eye(2), [1.0, 2.0], dim=1), [0.0, 0.0]).residual == 0.0


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_nan_velocity_has_an_infinite_residual(dim: int) -> None:
    problem = ContactProblem.from_delassus(np.eye(dim), np.eye(dim)[0], 0.5, dim=dim)
    rolling = ContactProblem.from_delassus(np.eye(4), np.eye(4)[0], laws=Laws.contacts(0.5, 3, 1).with_rolling(0.1, 1))
    for one in (problem, rolling):
        for row in range(one.n_rows):
            for impulses in (np.zeros(one.n_rows), -np.eye(one.n_rows)[row]):
                velocity = np.zeros(one.n_rows)
                velocity[row] = np.nan
                assert Residual(one)(impulses, velocity) == np.inf


@pytest.mark.parametrize("impulses", [(1e200, 0.0, 0.0), (1e170, 1e160, -1e160), (0.0, 1e155, 1e155)])
def test_overflowing_squares_do_not_hide_a_residual(impulses: tuple[float, float, float]) -> None:
    problem = ContactProblem.from_delassus(np.diag([0.0, 1.0, 1.0]), (1.0, 0.5, 0.0), 0.5)
    assert judge(problem, impulses).residual >= 0.5


def test_impulses_whose_products_overflow_are_no_solution() -> None:
    problem = ContactProblem.from_factors(1e200 * WALLS, np.ones(2), [-1.0, 0.1, -1.0, 0.1], 0.5, dim=2)
    assert judge(problem, [1e200, 0.0, 1e200, 0.0]).residual == np.inf


@pytest.mark.parametrize("name", ["hard-stack-2-top-1e8", "hard-stack-10-top-1e8", "hard-stack-10-growing-1e8"])
def test_known_impulses_of_stacks_are_judged_exactly(name: str) -> None:
    problem = load(name)
    assert problem.answer is not None
    impulses = problem.answer.impulses[0]
    exact = float(exact_residual(problem, impulses))
    assert judge(problem, impulses).residual == pytest.approx(exact, rel=1e-9)
    assert Residual(problem).judged(problem, impulses) == judge(problem, impulses).residual


def test_friction_without_effect_is_judged_although_its_bound_overflows() -> None:
    laws = Laws.contacts(2.0, 2, 2)
    problem = ContactProblem.from_delassus(np.diag([1.0, 0.0, 1.0, 1.0]), [1.0, 0.0, 1.0, 0.0], laws=laws)
    assert judge(problem, [1.7e308, 0.0, 0.0, 0.0]).residual >= 1.0


@pytest.mark.parametrize("impulse", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_nonfinite_impulses_do_not_solve_a_contact_even_if_they_have_no_effect(dim: int, impulse: float) -> None:
    """With G = 0 the products of impulses are not finite either, and the contact separates."""
    velocity = np.zeros(dim)
    velocity[0] = 1.0
    problem = ContactProblem.from_delassus(np.zeros((dim, dim)), velocity, 0.3, dim=dim)
    for row in range(dim):
        impulses = np.zeros(dim)
        impulses[row] = impulse
        assert Residual(problem).judged(problem, impulses) == np.inf
        assert judge(problem, impulses).residual == np.inf
