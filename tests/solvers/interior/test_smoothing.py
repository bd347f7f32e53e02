"""The manifold r∘û = τ e: every vector is r − û for exactly one of its points; the limit τ → 0 is the projection."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from proxbench.solvers.interior import cones
from proxbench.solvers.interior.smoothing import on_manifold, radius_in_disc

Vector = NDArray[np.float64]

vectors = st.lists(st.floats(-100.0, 100.0), min_size=3, max_size=3).map(np.array)
taus = st.integers(-30, 3).map(lambda exponent: 10.0**exponent)


def split(kind: int, v: Vector, tau: float, fixed: float = 0.0, friction: float = 0.0) -> tuple[Vector, Vector, float]:
    r, u, s = on_manifold(np.array([kind]), np.array([fixed]), np.array([friction]), tau, v[None])
    return r[0], u[0], float(s[0])


@given(v=vectors, tau=taus)
def test_smoothed_parts_lie_in_the_cone_with_difference_v_and_product_tau(v: Vector, tau: float) -> None:
    r, u, s = split(cones.CONE, v, tau)
    size = max(np.abs(v).max(), np.sqrt(tau))
    assert np.abs(r - u - v).max() <= 1e-14 * size
    assert r[0] >= np.hypot(*r[1:]) * (1.0 - 1e-14)
    assert u[0] >= np.hypot(*u[1:]) * (1.0 - 1e-14)
    assert abs(r @ u - tau) <= 1e-12 * (size**2 + tau)
    assert abs(s - np.hypot(*u[1:])) <= 1e-14 * size


@given(v=vectors)
def test_smoothing_tends_to_the_projection_onto_the_cone(v: Vector) -> None:
    r, u, _ = split(cones.CONE, v, 1e-300)
    length = np.hypot(v[1], v[2])
    eigenvalues = np.array([v[0] + length, v[0] - length])
    assert abs(r[0] - 0.5 * np.maximum(eigenvalues, 0.0).sum()) <= 1e-13 * (1.0 + np.abs(v).max())
    assert abs(r @ u) <= 1e-10 * (1.0 + np.abs(v).max() ** 2)


@given(length=st.floats(0.0, 1e6), bound=st.floats(1e-6, 1e6), tau=taus)
def test_the_radius_in_a_disc_solves_its_equation(length: float, bound: float, tau: float) -> None:
    radius, rest = radius_in_disc(length, bound, tau)
    assert 0.0 <= radius <= bound
    assert rest > 0.0
    reached = radius * (1.0 + tau / (rest * (bound + radius)))
    assert abs(reached - length) <= 1e-9 * (length + bound)


@given(v=vectors, tau=st.integers(-12, 1).map(lambda exponent: 10.0**exponent), bound=st.floats(0.01, 10.0))
def test_a_disc_bounds_its_impulse_and_opposes_its_velocity(v: Vector, tau: float, bound: float) -> None:
    r, u, s = split(cones.DISC, v, tau, fixed=bound)
    assert np.hypot(*r[1:]) <= bound
    assert s >= np.hypot(*u[1:])
    assert r[1:] @ u[1:] <= 0.0
    assert abs(s * bound + r[1:] @ u[1:] - tau) <= 1e-6 * tau + 1e-13 * np.abs(v).max() * bound
