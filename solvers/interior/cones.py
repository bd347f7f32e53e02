"""The cones of contacts, and Newton's equations on each of them.

A contact has its lanes r = (N, T₁, T₂) of impulses and û of velocities, scaled so that a friction cone is the
second-order cone L = {x : x₀ ≥ ‖x̄‖}. With the Jordan product x∘y = (xᵀy, x₀ȳ + y₀x̄) and e = (1, 0, 0), its laws are

    NORMAL   r_N û_N = τ
    CONE     r ∘ û = τ e,                     û_N = ξ_N + s,  s = ‖û_T‖ (De Saxcé)
    DISC     (b, r_T) ∘ (s, û_T) = τ e        with a bound b that stays and a slack s
    BOTH     as NORMAL and DISC               with b = a + μ r_N

at τ → 0, inside the cones before. A contact has at most one second-order cone, the pair (p, q) of ``write_pairs``; on
it dq = x₀ − D₀ dp is what linearising p ∘ q = τ e gives, and eliminating dû from all contacts leaves (Ĝ + D) dr.
Every determinant is a product, (x₀ − ‖x̄‖)(x₀ + ‖x̄‖): a difference of squares would lose it near the boundary.
"""

import numpy as np
from numba import njit

IDLE, NORMAL, CONE, DISC, BOTH = 0, 1, 2, 3, 4
"""The kinds of contact, in numbers that kernels compare; an idle one bears no impulse."""

INSIDE = 1e-15
"""How far inside the boundary of a cone iterates are kept, relative to their size."""


@njit(cache=True, error_model="numpy")
def determinant(x0, x1, x2):  # type: ignore[no-untyped-def]
    """Return the product of both eigenvalues, x₀² − ‖x̄‖²."""
    length = np.sqrt(x1 * x1 + x2 * x2)
    return (x0 - length) * (x0 + length)


@njit(cache=True, error_model="numpy")
def to_boundary(x0, x1, x2, d0, d1, d2):  # type: ignore[no-untyped-def]
    """Return the least t > 0 for which x + td is on the boundary of the cone, x inside; inf if there is none."""
    length = np.sqrt(d1 * d1 + d2 * d2)
    a, half_b = (d0 - length) * (d0 + length), x0 * d0 - x1 * d1 - x2 * d2
    c, least = determinant(x0, x1, x2), np.inf
    if d0 < 0.0:
        least = -x0 / d0
    under = half_b * half_b - a * c
    if under < 0.0:
        return least
    root = -half_b + np.sqrt(under) if half_b < 0.0 else -half_b - np.sqrt(under)
    if root > 0.0:
        least = min(least, c / root)
    if a != 0.0 and root / a > 0.0:
        least = min(least, root / a)
    return least


@njit(cache=True, error_model="numpy")
def write_pairs(kind, bound, r, u, slack, p, q):  # type: ignore[no-untyped-def]
    """Write the pair (p, q) of each contact's second-order cone."""
    for i in range(len(kind)):
        for lane in range(3):
            p[i, lane], q[i, lane] = r[i, lane], u[i, lane]
        if kind[i] >= DISC:
            p[i, 0], q[i, 0] = bound[i], slack[i]


@njit(cache=True, error_model="numpy")
def arrow_inverse_times(p0, p1, p2, g0, g1, g2):  # type: ignore[no-untyped-def]
    """Return L(p)⁻¹ g for the arrow matrix L(p) x = p ∘ x."""
    along = p1 * g1 + p2 * g2
    head = (p0 * g0 - along) / determinant(p0, p1, p2)
    return head, (g1 - head * p1) / p0, (g2 - head * p2) / p0


@njit(cache=True, error_model="numpy")
def linearise_plainly(kind, p, q, target, second, matrices, shifts):  # type: ignore[no-untyped-def]
    """Write D₀ = L(p)⁻¹ L(q) and x₀ = L(p)⁻¹ (στ e − p∘q − dp_a∘dq_a) of each cone.

    ``target`` is στ, ``second`` the product of the predictor's steps, shape (n, 4): the cone's, then the normal's.
    """
    for i in range(len(kind)):
        if kind[i] < CONE:
            continue
        p0, p1, p2 = p[i]
        q0, q1, q2 = q[i]
        d = matrices[i]
        d[0, 0], d[1, 0], d[2, 0] = arrow_inverse_times(p0, p1, p2, q0, q1, q2)
        d[0, 1], d[1, 1], d[2, 1] = arrow_inverse_times(p0, p1, p2, q1, q0, 0.0)
        d[0, 2], d[1, 2], d[2, 2] = arrow_inverse_times(p0, p1, p2, q2, 0.0, q0)
        shifts[i, 0], shifts[i, 1], shifts[i, 2] = arrow_inverse_times(
            p0,
            p1,
            p2,
            target - (p0 * q0 + p1 * q1 + p2 * q2) - second[i, 0],
            -(p0 * q1 + q0 * p1) - second[i, 1],
            -(p0 * q2 + q0 * p2) - second[i, 2],
        )


@njit(cache=True, error_model="numpy")
def linearise_by_nesterov_todd(kind, p, q, target, second, matrices, shifts):  # type: ignore[no-untyped-def]
    """Write D₀ = Q_w⁻¹ with Q_w q = p (Nesterov & Todd 1997) and x₀ = στ p⁻¹ − q of each cone; as above.

    D₀ is symmetric here. The second-order term is left out.
    """
    for i in range(len(kind)):
        if kind[i] < CONE:
            continue
        p0, p1, p2 = p[i]
        q0, q1, q2 = q[i]
        det = determinant(p0, p1, p2)
        norm_p, norm_q = np.sqrt(det), np.sqrt(determinant(q0, q1, q2))
        cosine = (p0 * q0 + p1 * q1 + p2 * q2) / (norm_p * norm_q)
        size = 1.0 / np.sqrt(2.0 * (1.0 + cosine))
        v0 = size * (p0 / norm_p + q0 / norm_q)
        v1 = -size * (p1 / norm_p - q1 / norm_q)
        v2 = -size * (p2 / norm_p - q2 / norm_q)
        ratio, d = norm_q / norm_p, matrices[i]
        d[0, 0] = ratio * (2.0 * v0 * v0 - 1.0)
        d[1, 1], d[2, 2] = ratio * (2.0 * v1 * v1 + 1.0), ratio * (2.0 * v2 * v2 + 1.0)
        d[0, 1] = d[1, 0] = ratio * 2.0 * v0 * v1
        d[0, 2] = d[2, 0] = ratio * 2.0 * v0 * v2
        d[1, 2] = d[2, 1] = ratio * 2.0 * v1 * v2
        shifts[i, 0] = target * p0 / det - q0
        shifts[i, 1], shifts[i, 2] = -target * p1 / det - q1, -target * p2 / det - q2


@njit(cache=True, error_model="numpy")
def couple(kind, friction, share, r, u, matrices, shifts, target, second, coupled, right):  # type: ignore[no-untyped-def]
    """Write D and the right side x of (Ĝ + D) dr = x + …, from D₀ and x₀ of the cones.

    Of De Saxcé's term the ``share`` z enters: D = (I − zZ) D₀, x = (I − zZ) x₀, Z = e_N ζᵀ, ζ = û_T/‖û_T‖; of a moving
    bound the same share of its change, z μ dr_N.
    """
    for i in range(len(kind)):
        for lane in range(3):
            right[i, lane] = 0.0
            for other in range(3):
                coupled[i, lane, other] = 1.0 if lane == other else 0.0
        if kind[i] == NORMAL or kind[i] == BOTH:
            coupled[i, 0, 0] = u[i, 0] / r[i, 0]
            right[i, 0] = (target - u[i, 0] * r[i, 0] - second[i, 3]) / r[i, 0]
        if kind[i] == CONE:
            length = np.sqrt(u[i, 1] ** 2 + u[i, 2] ** 2)
            z = share[i] / length if length > 0.0 else 0.0
            z1, z2 = z * u[i, 1], z * u[i, 2]
            for lane in range(3):
                for other in range(3):
                    coupled[i, lane, other] = matrices[i, lane, other]
                coupled[i, 0, lane] -= z1 * matrices[i, 1, lane] + z2 * matrices[i, 2, lane]
                right[i, lane] = shifts[i, lane]
            right[i, 0] -= z1 * shifts[i, 1] + z2 * shifts[i, 2]
        if kind[i] >= DISC:
            for lane in range(1, 3):
                coupled[i, lane, 0] = share[i] * friction[i] * matrices[i, lane, 0]
                coupled[i, lane, 1], coupled[i, lane, 2] = matrices[i, lane, 1], matrices[i, lane, 2]
                right[i, lane] = shifts[i, lane]


@njit(cache=True, error_model="numpy")
def follow(  # type: ignore[no-untyped-def]
    kind, friction, share, u, matrices, shifts, coupled, right, lag, dr, du, ds
):
    """Write dû and ds that belong to dr; ``lag`` is s − ‖û_T‖, which ds takes away."""
    for i in range(len(kind)):
        du[i] = 0.0
        ds[i] = 0.0
        if kind[i] == NORMAL or kind[i] == BOTH:
            du[i, 0] = right[i, 0] - coupled[i, 0, 0] * dr[i, 0]
        if kind[i] == CONE:
            for lane in range(3):
                du[i, lane] = shifts[i, lane]
                for other in range(3):
                    du[i, lane] -= matrices[i, lane, other] * dr[i, other]
            length = np.sqrt(u[i, 1] ** 2 + u[i, 2] ** 2)
            z = share[i] / length if length > 0.0 else 0.0
            ds[i] = z * (u[i, 1] * du[i, 1] + u[i, 2] * du[i, 2]) - lag[i]
        if kind[i] >= DISC:
            bound_change = share[i] * friction[i] * dr[i, 0]
            for lane in range(3):
                change = shifts[i, lane] - matrices[i, lane, 0] * bound_change
                change -= matrices[i, lane, 1] * dr[i, 1] + matrices[i, lane, 2] * dr[i, 2]
                if lane == 0:
                    ds[i] = change
                else:
                    du[i, lane] = change


@njit(cache=True, error_model="numpy")
def longest_steps(kind, friction, p, q, r, u, dr, du, ds, longest):  # type: ignore[no-untyped-def]
    """Write how far each contact can go along its step before it meets a boundary; return the least."""
    least = np.inf
    for i in range(len(kind)):
        t = np.inf
        if kind[i] == NORMAL or kind[i] == BOTH:
            if dr[i, 0] < 0.0:
                t = min(t, -r[i, 0] / dr[i, 0])
            if du[i, 0] < 0.0:
                t = min(t, -u[i, 0] / du[i, 0])
        if kind[i] >= CONE:
            dp, dq = (dr[i, 0], du[i, 0]) if kind[i] == CONE else (friction[i] * dr[i, 0], ds[i])
            t = min(t, to_boundary(p[i, 0], p[i, 1], p[i, 2], dp, dr[i, 1], dr[i, 2]))
            t = min(t, to_boundary(q[i, 0], q[i, 1], q[i, 2], dq, du[i, 1], du[i, 2]))
        longest[i] = t
        least = min(least, t)
    return least


@njit(cache=True, error_model="numpy")
def complementarity(kind, p, q, r, u):  # type: ignore[no-untyped-def]
    """Return the mean of p·q over all cones, half-lines included, and ‖p∘q‖₂ over all."""
    total, squares, count = 0.0, 0.0, 0
    for i in range(len(kind)):
        if kind[i] == NORMAL or kind[i] == BOTH:
            total += r[i, 0] * u[i, 0]
            squares += (r[i, 0] * u[i, 0]) ** 2
            count += 1
        if kind[i] >= CONE:
            head = p[i, 0] * q[i, 0] + p[i, 1] * q[i, 1] + p[i, 2] * q[i, 2]
            total += head
            squares += head**2
            for lane in range(1, 3):
                squares += (p[i, 0] * q[i, lane] + q[i, 0] * p[i, lane]) ** 2
            count += 1
    return total / max(count, 1), np.sqrt(squares)


@njit(cache=True, error_model="numpy")
def write_second_order(kind, friction, dr, du, ds, second):  # type: ignore[no-untyped-def]
    """Write dp∘dq of each cone and dr_N dû_N of each half-line (Mehrotra 1992)."""
    for i in range(len(kind)):
        second[i] = 0.0
        if kind[i] == NORMAL or kind[i] == BOTH:
            second[i, 3] = dr[i, 0] * du[i, 0]
        if kind[i] >= CONE:
            dp, dq = (dr[i, 0], du[i, 0]) if kind[i] == CONE else (friction[i] * dr[i, 0], ds[i])
            second[i, 0] = dp * dq + dr[i, 1] * du[i, 1] + dr[i, 2] * du[i, 2]
            second[i, 1] = dp * du[i, 1] + dq * dr[i, 1]
            second[i, 2] = dp * du[i, 2] + dq * dr[i, 2]


@njit(cache=True, error_model="numpy")
def keep_inside(kind, bound, r, u, slack):  # type: ignore[no-untyped-def]
    """Move what rounding has left on a boundary, or beyond it, back inside."""
    least = 1e-300
    for i in range(len(kind)):
        length_r, length_u = np.sqrt(r[i, 1] ** 2 + r[i, 2] ** 2), np.sqrt(u[i, 1] ** 2 + u[i, 2] ** 2)
        if kind[i] == NORMAL or kind[i] == BOTH:
            r[i, 0], u[i, 0] = max(r[i, 0], least), max(u[i, 0], least)
        if kind[i] == CONE:
            r[i, 0] = max(r[i, 0], (1.0 + INSIDE) * length_r + least)
            u[i, 0] = max(u[i, 0], (1.0 + INSIDE) * length_u + least)
        if kind[i] >= DISC:
            slack[i] = max(slack[i], (1.0 + INSIDE) * length_u + least)
            if length_r >= (1.0 - INSIDE) * bound[i]:
                shrunk = (1.0 - INSIDE) * bound[i] / length_r
                r[i, 1] *= shrunk
                r[i, 2] *= shrunk
