"""The semi-analytic primal method: its derivatives, and its answers to the convex model with unequal masses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proxbench.problems import Model, judge, load
from proxbench.solvers import Status, create, solve
from proxbench.solvers.newton.sap import _derivatives, _Springs
from proxbench.solvers.sweeps.cone import ConeProblem
from scipy.optimize import approx_fprime


@pytest.mark.parametrize("name", ["funnel-30-early", "funnel-planar-30"])
@given(seed=st.integers(0, 2**20))
def test_derivatives_of_projections_agree_with_differences(name: str, seed: int) -> None:
    """Differences over a kink of the projection are not a derivative, so a few points may deviate."""
    cone, chance = ConeProblem.of(load(name)), np.random.default_rng(seed)
    layout = cone.layout
    point, direction = chance.normal(size=(2, layout.n_blocks, layout.width))
    small = 1e-7
    there, back = (cone.projected(layout.unpad(point + sign * small * direction)) for sign in (1.0, -1.0))
    expected = layout.pad((there - back) / (2.0 * small))
    found = np.einsum("nij,nj->ni", _derivatives(cone, point), direction)
    assert np.median(np.abs(found - expected)) <= 1e-7
    assert (np.abs(found - expected).max(axis=1) > 1e-6).mean() <= 0.1


def test_derivatives_are_symmetric_and_between_zero_and_one() -> None:
    """A projection onto a convex set is the gradient of a convex function, and is nonexpansive."""
    cone = ConeProblem.of(load("funnel-100"))
    points = np.random.default_rng(0).normal(size=(cone.layout.n_blocks, cone.layout.width))
    found = _derivatives(cone, points)
    assert np.abs(found - found.transpose(0, 2, 1)).max() <= 1e-15
    values = np.linalg.eigvalsh(found)
    assert values.min() >= -1e-12
    assert values.max() <= 1.0 + 1e-12


def test_the_gradient_is_that_of_the_value() -> None:
    problem = load("funnel-30-early")
    assert problem.factors is not None
    cone = ConeProblem.of(problem)
    directions = problem.factors.scaled_directions @ np.diag(cone.size)
    springs = _Springs(cone, directions)
    w = 0.1 * np.random.default_rng(2).normal(size=directions.shape[0])
    gradient = w - directions @ springs.impulses(w)
    assert approx_fprime(w, springs.value, 1e-7) == pytest.approx(gradient, rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("name", ["hard-stack-10-top-heavy", "hard-tower-10-top-1e4", "funnel-100"])
def test_it_solves_the_convex_model_in_few_steps(name: str) -> None:
    problem = load(name)
    solution = solve(problem, "SAP", tolerance=1e-8, max_iterations=120)
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses, Model.CONVEX).residual <= 1e-8


def test_problems_without_bodies_are_declined() -> None:
    assert "holds G only" in str(create("SAP").supports(load("hard-counterexample")))
