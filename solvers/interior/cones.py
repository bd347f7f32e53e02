"""The cones of contacts, and Newton's equations on each of them.

A cone has the lanes (N, T₁, T₂, …) of impulses r and of velocities û, scaled (``scaled_problem``) so that a friction
cone is the second-order cone L = {x : x₀ ≥ ‖x̄‖}. With the Jordan product x∘y = (xᵀy, x₀ȳ + y₀x̄) and e = (1, 0, …),
the laws of the kinds are

    NORMAL   r_N û_N = τ
    CONE     r ∘ û = τ e,                     û_N = ξ_N + s,  s = ‖û_T‖ (De Saxcé)
    DISC     (b, r_T) ∘ (s, û_T) = τ e        with a fixed bound b and a slack s
    BOTH     as NORMAL and DISC               with b = a + μ r_N
    JOINT    û_N = 0                          for r_N of any sign

in the limit τ → 0. For τ > 0, iterates are inside the cones. Each kind has at most one second-order cone, with the pair
(p, q) of ``write_pairs``. Linearising p ∘ q = τ e gives dq = x₀ − D₀ dp, and eliminating dû from all equations leaves a
system in dr with the matrix Ĝ + D. Every determinant is computed as a product, (x₀ − ‖x̄‖)(x₀ + ‖x̄‖), because a
difference of squares would lose digits near the boundary.
"""

import numpy as np
from numba import njit

IDLE, JOINT, NORMAL, CONE, DISC, BOTH = 0, 1, 2, 3, 4, 5
"""The kinds of cones, as numbers for kernels; an idle cone has no impulse."""

INSIDE = 1e-15
"""Smallest distance of iterates from the boundary of a cone, relative to their size."""

SOFTNESS = 1e-9
"""Entry of D for a joint; entries of Ĝ are about 1. It makes systems with redundant joints regular."""


@njit(cache=True, error_model="numpy")
def dot_tangential(x, y):  # type: ignore[no-untyped-def]
    """Return x̄ᵀȳ."""
    total = 0.0
    for lane in range(1, len(x)):
        total += x[lane] * y[lane]
    return total


@njit(cache=True, error_model="numpy")
def tangential_length(x):  # type: ignore[no-untyped-def]
    """Return ‖x̄‖."""
    return np.sqrt(dot_tangential(x, x))


@njit(cache=True, error_model="numpy")
def determinant(x):  # type: ignore[no-untyped-def]
    """Return the product of both eigenvalues, x₀² − ‖x̄‖²."""
    length = tangential_length(x)
    return (x[0] - length) * (x[0] + length)


@njit(cache=True, error_model="numpy")
def step_to_boundary(x, d0, d):  # type: ignore[no-untyped-def]
    """Return the smallest t > 0 with x + t(d₀, d̄) on the boundary of the cone, for x inside; inf if there is none."""
    length = tangential_length(d)
    a, half_b = (d0 - length) * (d0 + length), x[0] * d0 - dot_tangential(x, d)
    c, shortest = determinant(x), np.inf
    if d0 < 0.0:
        shortest = -x[0] / d0
    discriminant = half_b * half_b - a * c
    if discriminant < 0.0:
        return shortest
    root = -half_b + np.sqrt(discriminant) if half_b < 0.0 else -half_b - np.sqrt(discriminant)
    if root > 0.0:
        shortest = min(shortest, c / root)
    if a != 0.0 and root / a > 0.0:
        shortest = min(shortest, root / a)
    return shortest


@njit(cache=True, error_model="numpy")
def write_pairs(kind, bound, r, u, slack, p, q):  # type: ignore[no-untyped-def]
    """Write the pair (p, q) of each second-order cone."""
    for i in range(len(kind)):
        for lane in range(r.shape[1]):
            p[i, lane], q[i, lane] = r[i, lane], u[i, lane]
        if kind[i] >= DISC:
            p[i, 0], q[i, 0] = bound[i], slack[i]


@njit(cache=True, error_model="numpy")
def divide_by_arrow(p, g):  # type: ignore[no-untyped-def]
    """Replace g by L(p)⁻¹ g for the arrow matrix L(p) x = p ∘ x."""
    scalar = (p[0] * g[0] - dot_tangential(p, g)) / determinant(p)
    g[0] = scalar
    for lane in range(1, len(p)):
        g[lane] = (g[lane] - scalar * p[lane]) / p[0]


@njit(cache=True, error_model="numpy")
def linearise(kind, p, q, target, second, matrices, shifts):  # type: ignore[no-untyped-def]
    """Write D₀ = L(p)⁻¹ L(q) and x₀ = L(p)⁻¹ (στ e − p∘q − dp_a∘dq_a) of each cone.

    ``target`` is στ, and ``second`` holds dp_a∘dq_a of the affine step: the lanes of the cone, then the half-line.
    """
    width = p.shape[1]
    for i in range(len(kind)):
        if kind[i] < CONE:
            continue
        a, b, d = p[i], q[i], matrices[i]
        det = determinant(a)
        for column in range(width):
            if column == 0:
                scalar = (a[0] * b[0] - dot_tangential(a, b)) / det
            else:
                scalar = (a[0] * b[column] - a[column] * b[0]) / det
            d[0, column] = scalar
            for lane in range(1, width):
                entry = b[lane] if column == 0 else (b[0] if lane == column else 0.0)
                d[lane, column] = (entry - scalar * a[lane]) / a[0]
        shifts[i, 0] = target - a[0] * b[0] - dot_tangential(a, b) - second[i, 0]
        for lane in range(1, width):
            shifts[i, lane] = -(a[0] * b[lane] + b[0] * a[lane]) - second[i, lane]
        divide_by_arrow(a, shifts[i])


@njit(cache=True, error_model="numpy")
def couple(kind, friction, share, r, u, matrices, shifts, target, second, coupled, right):  # type: ignore[no-untyped-def]
    """Write D and the right-hand side x of (Ĝ + D) dr = x + …, from D₀ and x₀ of the cones.

    Only the ``share`` z of De Saxcé's term enters: D = (I − zZ) D₀, x = (I − zZ) x₀, Z = e_N ζᵀ, ζ = û_T/‖û_T‖. For a
    variable bound, the same share of its change enters, z μ dr_N.
    """
    width = r.shape[1]
    for i in range(len(kind)):
        for lane in range(width):
            right[i, lane] = 0.0
            for other in range(width):
                coupled[i, lane, other] = 1.0 if lane == other else 0.0
        if kind[i] == JOINT:
            coupled[i, 0, 0] = SOFTNESS
        if kind[i] == NORMAL or kind[i] == BOTH:
            coupled[i, 0, 0] = u[i, 0] / r[i, 0]
            right[i, 0] = (target - u[i, 0] * r[i, 0] - second[i, width]) / r[i, 0]
        if kind[i] == CONE:
            length = tangential_length(u[i])
            z = share[i] / length if length > 0.0 else 0.0
            for lane in range(width):
                right[i, lane] = shifts[i, lane]
                for other in range(width):
                    coupled[i, lane, other] = matrices[i, lane, other]
            for lane in range(1, width):
                along = z * u[i, lane]
                right[i, 0] -= along * shifts[i, lane]
                for other in range(width):
                    coupled[i, 0, other] -= along * matrices[i, lane, other]
        if kind[i] >= DISC:
            for lane in range(1, width):
                right[i, lane] = shifts[i, lane]
                coupled[i, lane, 0] = share[i] * friction[i] * matrices[i, lane, 0]
                for other in range(1, width):
                    coupled[i, lane, other] = matrices[i, lane, other]


@njit(cache=True, error_model="numpy")
def write_changes(  # type: ignore[no-untyped-def]
    kind, friction, share, u, matrices, shifts, coupled, right, lag, dr, du, ds
):
    """Write dû and ds for dr; ``lag`` is s − ‖û_T‖, which ds removes."""
    width = u.shape[1]
    for i in range(len(kind)):
        du[i] = 0.0
        ds[i] = 0.0
        if kind[i] == NORMAL or kind[i] == BOTH:
            du[i, 0] = right[i, 0] - coupled[i, 0, 0] * dr[i, 0]
        if kind[i] == CONE:
            for lane in range(width):
                du[i, lane] = shifts[i, lane]
                for other in range(width):
                    du[i, lane] -= matrices[i, lane, other] * dr[i, other]
            length = tangential_length(u[i])
            z = share[i] / length if length > 0.0 else 0.0
            ds[i] = z * dot_tangential(u[i], du[i]) - lag[i]
        if kind[i] >= DISC:
            bound_change = share[i] * friction[i] * dr[i, 0]
            for lane in range(width):
                change = shifts[i, lane] - matrices[i, lane, 0] * bound_change
                for other in range(1, width):
                    change -= matrices[i, lane, other] * dr[i, other]
                if lane == 0:
                    ds[i] = change
                else:
                    du[i, lane] = change


@njit(cache=True, error_model="numpy")
def longest_steps(kind, friction, p, q, r, u, dr, du, ds):  # type: ignore[no-untyped-def]
    """Return the longest step that stays inside all cones."""
    shortest = np.inf
    for i in range(len(kind)):
        t = np.inf
        if kind[i] == NORMAL or kind[i] == BOTH:
            if dr[i, 0] < 0.0:
                t = min(t, -r[i, 0] / dr[i, 0])
            if du[i, 0] < 0.0:
                t = min(t, -u[i, 0] / du[i, 0])
        if kind[i] >= CONE:
            dp, dq = (dr[i, 0], du[i, 0]) if kind[i] == CONE else (friction[i] * dr[i, 0], ds[i])
            t = min(t, step_to_boundary(p[i], dp, dr[i]))
            t = min(t, step_to_boundary(q[i], dq, du[i]))
        shortest = min(shortest, t)
    return shortest


@njit(cache=True, error_model="numpy")
def complementarity(kind, p, q, r, u):  # type: ignore[no-untyped-def]
    """Return the mean of p·q over all cones, half-lines included, and the norm ‖p∘q‖₂ over all of them."""
    total, squares, count = 0.0, 0.0, 0
    for i in range(len(kind)):
        if kind[i] == NORMAL or kind[i] == BOTH:
            total += r[i, 0] * u[i, 0]
            squares += (r[i, 0] * u[i, 0]) ** 2
            count += 1
        if kind[i] >= CONE:
            scalar = p[i, 0] * q[i, 0] + dot_tangential(p[i], q[i])
            total += scalar
            squares += scalar**2
            for lane in range(1, p.shape[1]):
                squares += (p[i, 0] * q[i, lane] + q[i, 0] * p[i, lane]) ** 2
            count += 1
    return total / max(count, 1), np.sqrt(squares)


@njit(cache=True, error_model="numpy")
def write_second_order(kind, friction, dr, du, ds, second):  # type: ignore[no-untyped-def]
    """Write dp∘dq of each cone and dr_N dû_N of each half-line (Mehrotra 1992)."""
    width = dr.shape[1]
    for i in range(len(kind)):
        second[i] = 0.0
        if kind[i] == NORMAL or kind[i] == BOTH:
            second[i, width] = dr[i, 0] * du[i, 0]
        if kind[i] >= CONE:
            dp, dq = (dr[i, 0], du[i, 0]) if kind[i] == CONE else (friction[i] * dr[i, 0], ds[i])
            second[i, 0] = dp * dq + dot_tangential(dr[i], du[i])
            for lane in range(1, width):
                second[i, lane] = dp * du[i, lane] + dq * dr[i, lane]


@njit(cache=True, error_model="numpy")
def keep_inside(kind, bound, r, u, slack):  # type: ignore[no-untyped-def]
    """Move iterates that rounding has put on or beyond a boundary back inside."""
    min_distance = 1e-300
    for i in range(len(kind)):
        length_r, length_u = tangential_length(r[i]), tangential_length(u[i])
        if kind[i] == NORMAL or kind[i] == BOTH:
            r[i, 0], u[i, 0] = max(r[i, 0], min_distance), max(u[i, 0], min_distance)
        if kind[i] == CONE:
            r[i, 0] = max(r[i, 0], (1.0 + INSIDE) * length_r + min_distance)
            u[i, 0] = max(u[i, 0], (1.0 + INSIDE) * length_u + min_distance)
        if kind[i] >= DISC:
            slack[i] = max(slack[i], (1.0 + INSIDE) * length_u + min_distance)
            if length_r >= (1.0 - INSIDE) * bound[i]:
                factor = (1.0 - INSIDE) * bound[i] / length_r
                for lane in range(1, r.shape[1]):
                    r[i, lane] *= factor
