"""Projections are nearest points: feasible, and at an obtuse angle to everything else that is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import judge, load, project
from proxbench.problems.contact.projections import onto_friction_cone, onto_polygon

numbers = st.floats(-5.0, 5.0)


def cone_point(rng: np.random.Generator, friction: float, fixed: float) -> np.ndarray:
    normal = rng.uniform(0, 5)
    direction = rng.normal(size=2)
    direction *= rng.uniform(0, 1) * (fixed + friction * normal) / np.linalg.norm(direction)
    return np.array([normal, *direction])


@settings(max_examples=200, deadline=None)
@given(
    n=numbers,
    t=numbers,
    s=numbers,
    friction=st.floats(0.0, 5.0),
    fixed=st.sampled_from([0.0, 0.5]),
    seed=st.integers(0, 9999),
)
def test_the_cone_projection_satisfies_the_variational_inequality(
    n: float, t: float, s: float, friction: float, fixed: float, seed: int
) -> None:
    """(x − P(x))·(y − P(y)) ≤ 0 for every y of the set characterises the nearest point."""
    point = np.array([n, t, s])
    normal, tangent = onto_friction_cone(np.array([n]), np.array([[t, s]]), np.array([friction]), np.array([fixed]))
    projected = np.array([normal[0], *tangent[0]])
    assert projected[0] >= 0.0
    assert np.hypot(projected[1], projected[2]) <= fixed + friction * projected[0] + 1e-12
    rng = np.random.default_rng(seed)
    for _ in range(20):
        other = cone_point(rng, friction, fixed)
        assert (point - projected) @ (other - projected) <= 1e-10


@settings(max_examples=200, deadline=None)
@given(t=numbers, s=numbers, radius=st.floats(0.0, 3.0), sides=st.integers(3, 17))
def test_the_polygon_projection_satisfies_the_variational_inequality_at_the_corners(
    t: float, s: float, radius: float, sides: int
) -> None:
    point = np.array([t, s])
    projected = onto_polygon(point[None], np.array([radius]), sides)[0]
    corner_angles = 2 * np.pi * np.arange(sides) / sides
    corners = radius * np.column_stack([np.cos(corner_angles), np.sin(corner_angles)])
    middle = corner_angles + np.pi / sides
    edges = np.column_stack([np.cos(middle), np.sin(middle)])
    assert (edges @ projected).max() <= radius * np.cos(np.pi / sides) + 1e-12
    assert ((corners - projected) @ (point - projected)).max() <= 1e-10


@pytest.mark.parametrize("sides", [3, 4, 7])
def test_points_inside_stay(sides: int) -> None:
    points = np.random.default_rng(0).uniform(-0.3, 0.3, (50, 2))
    assert onto_polygon(points, np.ones(50), sides) == pytest.approx(points, abs=1e-15)


@pytest.mark.parametrize("name", ["hard-mixed-laws", "hard-tresca-joint", "hard-sliding-block", "hard-sticking-box"])
def test_projected_impulses_are_admissible_stay_when_projected_again_and_leave_the_given_ones(name: str) -> None:
    problem = load(name)
    given_impulses = np.random.default_rng(3).normal(size=problem.n_rows)
    kept = given_impulses.copy()
    projected = project(problem.laws, given_impulses)
    assert np.array_equal(given_impulses, kept)
    assert judge(problem, given_impulses).cone_violation > 0.1
    assert judge(problem, projected).cone_violation <= 1e-15
    assert np.allclose(project(problem.laws, projected), projected, rtol=1e-15, atol=0.0)


@pytest.mark.parametrize("name", ["hard-mixed-laws", "hard-tresca-joint"])
def test_a_solution_is_a_fixed_point_of_the_projected_gradient_step(name: str) -> None:
    problem = load(name)
    assert problem.answer is not None
    (solution,) = problem.answer.impulses
    for step in (0.1, 1.0):
        moved = project(problem.laws, solution - step * problem.relative_velocity(solution))
        assert np.abs(moved - solution).max() <= 1e-12
