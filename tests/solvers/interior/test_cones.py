"""The algebra of second-order cones, against its definitions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from proxbench.solvers.interior import cones

Vector = NDArray[np.float64]

numbers = st.floats(-10.0, 10.0)


@st.composite
def vectors(draw: st.DrawFn) -> Vector:
    return np.array([draw(numbers) for _ in range(3)])


@st.composite
def interior(draw: st.DrawFn) -> Vector:
    tangent = np.array([draw(numbers), draw(numbers)])
    return np.array([np.hypot(*tangent) + draw(st.floats(0.01, 10.0)), *tangent])


def jordan(x: Vector, y: Vector) -> Vector:
    return np.array([x @ y, *(x[0] * y[1:] + y[0] * x[1:])])


def linearised(p: Vector, q: Vector, target: float) -> tuple[Vector, Vector]:
    matrices, shifts = np.zeros((1, 3, 3)), np.zeros((1, 3))
    cones.linearise(np.array([cones.CONE]), p[None], q[None], target, np.zeros((1, 4)), matrices, shifts)
    return matrices[0], shifts[0]


@given(p=interior(), q=interior(), dp=vectors(), target=st.floats(0.0, 5.0))
def test_a_step_satisfies_complementarity_to_first_order(p: Vector, q: Vector, dp: Vector, target: float) -> None:
    matrix, shift = linearised(p, q, target)
    dq = shift - matrix @ dp
    left = jordan(p, q) + jordan(dp, q) + jordan(p, dq)
    size = 1.0 + np.abs(p).max() * (np.abs(dq).max() + np.abs(q).max()) + np.abs(q).max() * np.abs(dp).max()
    assert np.abs(left - [target, 0.0, 0.0]).max() <= 1e-10 * size


@given(p=interior(), target=st.floats(0.1, 5.0))
def test_the_linearisation_on_the_central_path_is_a_quotient_of_jordan_products(p: Vector, target: float) -> None:
    q = target * np.array([p[0], -p[1], -p[2]]) / cones.determinant(p)
    matrix, _ = linearised(p, q, target)
    step = np.array([0.3, -0.2, 0.1])
    assert np.abs(jordan(p, matrix @ step) - jordan(q, step)).max() <= 1e-9 * (
        1.0 + np.abs(matrix).max() * np.abs(p).max()
    )


@given(x=interior(), d=vectors())
def test_a_step_to_the_boundary_ends_there_and_no_earlier(x: Vector, d: Vector) -> None:
    t = cones.step_to_boundary(x, d[0], d)
    inside = x + (0.999 * t if np.isfinite(t) else 1e6) * d
    assert inside[0] >= np.hypot(inside[1], inside[2]) * (1.0 - 1e-9)
    if np.isfinite(t):
        end = x + t * d
        assert abs(end[0] - np.hypot(end[1], end[2])) <= 1e-6 * (np.abs(x).max() + t * np.abs(d).max())


def test_a_determinant_near_the_boundary_keeps_its_digits() -> None:
    gap = 2.0**-50
    assert cones.determinant(np.array([1.0 + gap, 1.0, 0.0])) == pytest.approx(2.0 * gap, rel=1e-12)


@given(p=interior(), q=interior(), seed=st.integers(0, 1000))
def test_rotations_and_a_zero_fourth_lane_do_not_change_a_cone(p: Vector, q: Vector, seed: int) -> None:
    """A fourth lane of zeros is added and all axes are rotated: the matrix rotates, its determinant is unchanged."""
    turn = np.eye(4)
    turn[1:, 1:] = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    wide_p, wide_q = turn @ np.append(p, 0.0), turn @ np.append(q, 0.0)
    matrices, shifts = np.zeros((1, 4, 4)), np.zeros((1, 4))
    cones.linearise(np.array([cones.CONE]), wide_p[None], wide_q[None], 0.5, np.zeros((1, 5)), matrices, shifts)
    matrix, shift = linearised(p, q, 0.5)
    turned = turn.T @ matrices[0] @ turn
    assert np.abs(turned[:3, :3] - matrix).max() <= 1e-7 * np.abs(matrix).max()
    assert np.abs(turned[3, :3]).max() <= 1e-7 * np.abs(matrix).max()
    assert np.abs((turn.T @ shifts[0])[:3] - shift).max() <= 1e-7 * (1.0 + np.abs(shift).max())
    assert cones.determinant(wide_p) == pytest.approx(cones.determinant(p), rel=1e-9)
