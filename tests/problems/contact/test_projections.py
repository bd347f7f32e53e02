"""Projections are nearest points: feasible, and at an obtuse angle to all other feasible points."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import LawKind, Laws, ProblemError, judge, load, project
from proxbench.problems.contact.laws import ConvexSet
from proxbench.problems.contact.projections import onto_cone, onto_polygon, project_rows

numbers = st.floats(-5.0, 5.0)


def cone_point(rng: np.random.Generator, friction: float, fixed: float) -> np.ndarray:
    normal = rng.uniform(0, 5)
    direction = rng.normal(size=2)
    direction *= rng.uniform(0, 1) * (fixed + friction * normal) / np.linalg.norm(direction)
    return np.array([normal, *direction])


@settings(max_examples=100, deadline=None)
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
    mu, a = (np.array([friction]),), (np.array([fixed]),)
    normal, (tangent,) = onto_cone(np.array([n]), (np.array([[t, s]]),), mu, a)
    projected = np.array([normal[0], *tangent[0]])
    assert projected[0] >= 0.0
    assert np.hypot(projected[1], projected[2]) <= fixed + friction * projected[0] + 1e-12
    rng = np.random.default_rng(seed)
    for _ in range(20):
        other = cone_point(rng, friction, fixed)
        assert (point - projected) @ (other - projected) <= 1e-10


@settings(max_examples=100, deadline=None)
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
def test_points_inside_the_polygon_are_unchanged(sides: int) -> None:
    points = np.random.default_rng(0).uniform(-0.3, 0.3, (50, 2))
    assert onto_polygon(points, np.ones(50), sides) == pytest.approx(points, abs=1e-15)


@pytest.mark.parametrize("name", ["hard-mixed-laws", "hard-tresca-joint", "hard-sliding-block", "hard-sticking-box"])
def test_projection_is_admissible_and_idempotent_and_does_not_modify_its_argument(name: str) -> None:
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


@settings(max_examples=100, deadline=None)
@given(
    n=numbers,
    parts=st.tuples(numbers, numbers, numbers, numbers, numbers),
    friction=st.tuples(st.floats(0.0, 5.0), st.floats(0.0, 5.0)),
    fixed=st.tuples(st.sampled_from([0.0, 0.5]), st.sampled_from([0.0, 0.5])),
    seed=st.integers(0, 9999),
)
def test_the_projection_onto_both_cones_satisfies_the_variational_inequality(
    n: float,
    parts: tuple[float, ...],
    friction: tuple[float, float],
    fixed: tuple[float, float],
    seed: int,
) -> None:
    tangent, rolling = np.array([parts[:2]]), np.array([parts[2:]])
    mu, a = tuple(np.array([x]) for x in friction), tuple(np.array([x]) for x in fixed)
    normal, (t, r) = onto_cone(np.array([n]), (tangent, rolling), mu, a)
    projected = np.array([normal[0], *t[0], *r[0]])
    assert projected[0] >= 0.0
    assert np.linalg.norm(t) <= fixed[0] + friction[0] * normal[0] + 1e-12
    assert np.linalg.norm(r) <= fixed[1] + friction[1] * normal[0] + 1e-12
    point, rng = np.array([n, *parts]), np.random.default_rng(seed)
    for _ in range(20):
        other = rng.uniform(-5.0, 5.0, size=6)
        other[0] = rng.choice([0.0, rng.uniform(0.0, 5.0)])
        for rows, mu_of, a_of in ((slice(1, 3), friction[0], fixed[0]), (slice(3, 6), friction[1], fixed[1])):
            other[rows] *= rng.uniform(0, 1) * (a_of + mu_of * other[0]) / np.linalg.norm(other[rows])
        assert (point - projected) @ (other - projected) <= 1e-10


def test_without_rolling_rows_both_cones_are_the_friction_cone() -> None:
    rng = np.random.default_rng(0)
    normal, tangent, friction = rng.normal(size=50), rng.normal(size=(50, 2)), rng.uniform(0, 2, 50)
    fixed, none = rng.choice([0.0, 0.3], 50), np.zeros(50)
    expected = onto_cone(normal, (tangent,), (friction,), (fixed,))
    found = onto_cone(normal, (tangent, np.zeros((50, 2))), (friction, none), (fixed, none))
    assert found[0] == pytest.approx(expected[0], abs=1e-15)
    assert found[1][0] == pytest.approx(expected[1][0], abs=1e-15)


@settings(max_examples=100, deadline=None)
@given(
    form=st.sampled_from(list(ConvexSet)), point=st.lists(numbers, min_size=3, max_size=3), bound=st.floats(0.0, 5.0)
)
def test_the_projection_onto_each_set_is_its_nearest_point_and_moves_no_other_row(
    form: ConvexSet, point: list[float], bound: float
) -> None:
    count, rng = 3 if form is ConvexSet.BALL else 1, np.random.default_rng(0)
    given_rows = np.array([7.0, *point, -7.0])
    rows = given_rows.copy()
    project_rows(int(form), 1, count, bound, rows)
    assert rows[0] == 7.0
    assert rows[1 + count :].tolist() == given_rows[1 + count :].tolist()
    projected, start = rows[1 : 1 + count], given_rows[1 : 1 + count]
    for other in rng.uniform(-5.0, 5.0, size=(20, count)):
        if form is ConvexSet.HALF_LINE:
            other = np.abs(other)
        if form is ConvexSet.BALL:
            other *= rng.uniform(0, 1) * bound / np.linalg.norm(other)
        assert (start - projected) @ (other - projected) <= 1e-10
    assert np.linalg.norm(projected) <= bound + 1e-12 or form is not ConvexSet.BALL
    assert projected[0] >= 0.0 or form is not ConvexSet.HALF_LINE


def test_friction_bound_uses_the_projected_normal_impulse_in_any_order() -> None:
    kind, partner = [LawKind.PLANAR_FRICTION, LawKind.UNILATERAL], np.array([1, -1])
    laws = Laws.in_order(kind, np.array([0.5, 0.0]), np.zeros(2), partner)
    assert project(laws, np.array([3.0, -1.0])).tolist() == [0.0, 0.0]
    assert project(laws, np.array([-3.0, 1.0])).tolist() == [-0.5, 1.0]


@pytest.mark.parametrize("rolling_rows", [1, 2, 3])
def test_impulses_of_joints_stay_and_each_friction_keeps_its_own_bound(rolling_rows: int) -> None:
    laws = Laws.concatenate([Laws.joints(1), Laws.contacts([0.5], 3, 1).with_rolling(0.1, rolling_rows)])
    given_impulses = np.array([-7.0, 2.0, 0.3, 0.4, *np.full(rolling_rows, 5.0)])
    projected = project(laws, given_impulses)
    assert projected[:4].tolist() == [-7.0, 2.0, 0.3, 0.4]
    assert projected[4:] == pytest.approx(np.full(rolling_rows, 0.2 / np.sqrt(rolling_rows)))


def test_a_point_inside_a_cone_keeps_its_normal_part_to_the_last_bit() -> None:
    """Methods take N = N₀ as the sign of a sticking contact."""
    rng = np.random.default_rng(5)
    normal, tangent = rng.uniform(0.0, 1.0, 10_000), rng.normal(size=(10_000, 2))
    mu = rng.uniform(0.05, 2.0, 10_000)
    tangent *= (mu * normal / np.linalg.norm(tangent, axis=1) * (1.0 - 1e-15))[:, None]
    inside = np.sqrt(np.einsum("ij,ij->i", tangent, tangent)) <= mu * normal
    found, (part,) = onto_cone(normal, (tangent,), (mu,), (np.zeros(10_000),))
    assert inside.sum() > 1000
    assert np.array_equal(found[inside], normal[inside])
    assert np.array_equal(part[inside], tangent[inside])


@pytest.mark.parametrize("impulses", [np.ones(2), np.ones(4), np.ones((1, 3)), 1.0, ["a", "b", "c"]])
def test_impulses_of_another_shape_or_type_are_refused(impulses: np.ndarray) -> None:
    with pytest.raises(ProblemError, match="impulses must"):
        project(Laws.contacts(0.5, 3, 1), impulses)
