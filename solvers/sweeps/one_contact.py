"""Exact solution of one contact with all other impulses fixed.

A contact with block G = [[G_NN, g_NTᵀ], [g_TN, G_TT]] and velocity q from all other impulses has the laws

    0 ≤ Λ_N ⊥ ξ_N ≥ 0,      −ξ_T ∈ N_D(Λ_T),  D = {‖x‖ ≤ a + μΛ_N},      ξ = GΛ + q.

Its states are tried one after the other: open (friction with bound a), stick (ξ = 0), slip (ξ_N = 0, ‖Λ_T‖ = a + μΛ_N,
Λ_T opposed to ξ_T). For a contact with an impulse, the order is stick, slip, open; a contact without an impulse stays
open if possible. The result depends on the current impulse only if several solutions exist (Painlevé). A rank-deficient
block leaves part of Λ_T undetermined. This part stays unchanged, or changes as little as the cone allows.

A singular block may have no solution, and rounding may exclude two neighbouring states. If no state is consistent, the
result is the candidate with the smallest violation, as the judge measures it.

``solve_usual_spatial`` finds the state of a regular block near the current impulse, and reports whether it succeeded,
which it almost always does. ``solve_spatial`` finds all states of any block, but takes seconds to compile.
"""

import numpy as np
from numba import njit

from .slip_angle import initial_direction, refine_direction, slip_directions, slip_polynomial

SINGULAR = 1e-12
"""A curvature below this fraction of the largest one of its block counts as zero."""

REFINEMENTS = 8
"""Largest number of Newton steps that refine an inconsistent slip."""

NO_JAM = 0.99
"""Value of (μ‖g_NT‖/G_NN)² below which friction cannot close a contact that opens without friction."""

ROUNDING_TOLERANCE = 1e-13
"""Velocities in the wrong direction and excesses over a bound count as rounding errors up to this share of their
terms."""


@njit(cache=True, inline="always")
def disc_scale(x, y, bound):  # type: ignore[no-untyped-def]
    """Return the factor that projects (x, y) onto the disc of radius ``bound``; exactly 1 inside it."""
    scale = 1.0
    squared = x * x + y * y
    if squared > bound * bound:
        scale = bound / np.sqrt(squared)
    return scale


@njit(cache=True, inline="always", error_model="numpy")
def solve_frictionless(g, q):  # type: ignore[no-untyped-def]
    """Return Λ_N ≥ 0 with ξ_N = g Λ_N + q ≥ 0 and one of them zero; 0 if impulses cause no velocity (g = 0)."""
    return max(-q / g, 0.0) if g > 0.0 else 0.0


@njit(cache=True, error_model="numpy")
def planar_violation(nn, nt, tn, tt, qn, qt, mu, a, n, t):  # type: ignore[no-untyped-def]
    """Return the larger violation of both laws [m/s], as the judge measures it."""
    xi_n, xi_t = nn * n + nt * t + qn, tn * n + tt * t + qt
    normal = abs(nn * n - max(nn * n - xi_n, 0.0))
    bound = tt * (a + mu * max(n, 0.0))
    return max(normal, abs(tt * t - min(max(tt * t - xi_t, -bound), bound)))


@njit(cache=True, error_model="numpy")
def solve_planar(nn, nt, tn, tt, qn, qt, mu, a, old_n, old_t):  # type: ignore[no-untyped-def]
    """Return (Λ_N, Λ_T) of a planar contact, or of a friction law without a normal law (nn = nt = tn = qn = 0)."""
    # open
    open_t = min(max(-qt / tt, -a), a) if tt > 0.0 else min(max(old_t, -a), a)
    gap = qn + nt * open_t
    if nn <= 0.0 or (old_n <= 0.0 and gap >= 0.0):
        return 0.0, open_t
    # stick: s Λ_T + r = 0, Λ_N = n0 − h Λ_T
    n0, h = -qn / nn, nt / nn
    s, r = tt - tn * h, qt + tn * n0
    rounding = ROUNDING_TOLERANCE * (abs(qt) + abs(tn * n0))
    if abs(s) > SINGULAR * tt:
        t = -r / s
        n = n0 - h * t
        if n >= 0.0 and abs(t) <= a + mu * n:
            return n, t
    elif abs(r) <= rounding:  # any Λ_T within its bounds
        t, is_consistent = _free_tangent(n0, h, mu, a, old_t)
        if is_consistent:
            return n0 - h * t, t
    # slip at either bound, the current one first
    best_n, best_t = 0.0, open_t
    min_violation = planar_violation(nn, nt, tn, tt, qn, qt, mu, a, 0.0, open_t)
    side = 1.0 if old_t >= 0.0 else -1.0
    for _ in range(2):
        denominator = 1.0 + side * mu * h
        if denominator != 0.0:
            n = (n0 - side * h * a) / denominator
            t = side * (a + mu * n)
            if n >= 0.0:
                if side * (s * t + r) <= 0.0:
                    return n, t
                violation = planar_violation(nn, nt, tn, tt, qn, qt, mu, a, n, t)
                if violation < min_violation:
                    best_n, best_t, min_violation = n, t, violation
        side = -side
    if gap >= 0.0:
        return 0.0, open_t
    current_n = max(n0 - h * old_t, 0.0)
    current_t = min(max(old_t, -a - mu * current_n), a + mu * current_n)
    if planar_violation(nn, nt, tn, tt, qn, qt, mu, a, current_n, current_t) < min_violation:
        return current_n, current_t
    return best_n, best_t


@njit(cache=True, error_model="numpy")
def _free_tangent(n0, h, mu, a, old):  # type: ignore[no-untyped-def]
    """Return the Λ_T closest to ``old`` with |Λ_T| ≤ a + μ(n0 − hΛ_T) and n0 − hΛ_T ≥ 0, and whether there is one."""
    low, high, fits = -np.inf, np.inf, True
    for slope, room in ((1.0 + mu * h, a + mu * n0), (-1.0 + mu * h, a + mu * n0), (h, n0)):  # slope · Λ_T ≤ room
        if slope > 0.0:
            high = min(high, room / slope)
        elif slope < 0.0:
            low = max(low, room / slope)
        elif room < 0.0:
            fits = False
    return min(max(old, low), high), fits and low <= high


@njit(cache=True, error_model="numpy")
def spatial_violation(g, qn, q1, q2, mu, a, n, t1, t2):  # type: ignore[no-untyped-def]
    """Return the larger violation of both laws [m/s], as the judge measures it; ``g`` is the block, flat."""
    xi_n = g[0] * n + g[1] * t1 + g[2] * t2 + qn
    xi_1 = g[3] * n + g[4] * t1 + g[5] * t2 + q1
    xi_2 = g[6] * n + g[7] * t1 + g[8] * t2 + q2
    normal = abs(g[0] * n - max(g[0] * n - xi_n, 0.0))
    alpha = max(g[4], g[8])
    bound = alpha * (a + mu * max(n, 0.0))
    x, y = alpha * t1 - xi_1, alpha * t2 - xi_2
    length = np.sqrt(x * x + y * y)
    if length > bound:
        x, y = x * bound / length, y * bound / length
    return max(normal, np.sqrt((alpha * t1 - x) ** 2 + (alpha * t2 - y) ** 2))


@njit(cache=True, error_model="numpy")
def solve_usual_spatial(g, qn, q1, q2, mu, a, old_n, old_1, old_2):  # type: ignore[no-untyped-def]
    """Return the result of ``solve_spatial`` and True, or False as the last value if the state is not a usual one.

    A usual state is open, stick of a regular block, or the slip to which Newton's method leads from the current
    impulse.
    """
    nn, n0, h1, h2 = g[0], 0.0, 0.0, 0.0
    if nn > 0.0:
        n0, h1, h2 = -qn / nn, g[1] / nn, g[2] / nn
        if a == 0.0 and qn >= 0.0 and (old_n <= 0.0 or (n0 < 0.0 and mu * mu * (h1 * h1 + h2 * h2) < NO_JAM)):
            return 0.0, 0.0, 0.0, True
        if a > 0.0 and old_n <= 0.0:
            return 0.0, 0.0, 0.0, False
    else:
        mu = 0.0
    s11, s12, s21, s22 = g[4] - g[3] * h1, g[5] - g[3] * h2, g[7] - g[6] * h1, g[8] - g[6] * h2
    r1, r2 = q1 + g[3] * n0, q2 + g[6] * n0
    size = max(max(abs(s11), abs(s12)), max(abs(s21), abs(s22)))
    if not abs(s11 * s22 - s12 * s21) > SINGULAR * max(g[4], g[8]) * size:
        return 0.0, 0.0, 0.0, False
    t1, t2 = _two_equations(s11, s12, s21, s22, r1, r2)
    n = n0 - h1 * t1 - h2 * t2
    bound = a + mu * n
    if n >= 0.0 and t1 * t1 + t2 * t2 <= bound * bound:
        return n, t1, t2, True
    c0, c1, c2, c3, c4 = slip_polynomial(s11, s12, s21, s22, r1, r2, mu * h1, mu * h2, a + mu * n0)
    x, y = initial_direction(old_1, old_2, r1, r2)
    x, y, converged = refine_direction(c0, c1, c2, c3, c4, x, y)
    n, t1, t2, slip_violation = _slip(s11, s12, s21, s22, r1, r2, n0, h1, h2, mu, a, x, y)
    return n, t1, t2, converged and slip_violation <= 0.0


@njit(cache=True, error_model="numpy")
def solve_spatial(g, qn, q1, q2, mu, a, old_n, old_1, old_2, work):  # type: ignore[no-untyped-def]
    """Return (Λ_N, Λ_T1, Λ_T2) of a spatial contact, or of a friction law alone (first row and column zero).

    ``g`` is the block, flat; ``qn``, ``q1``, ``q2`` are the velocity without the contact's own impulse; ``old_n``,
    ``old_1``, ``old_2`` are the current impulse; the friction bound is a + μΛ_N; ``work`` has
    ``slip_angle.WORKSPACE_SIZE`` entries.
    """
    nn, scale = g[0], max(g[4], g[8])
    if nn <= 0.0:
        t1, t2 = _friction_alone(g, q1, q2, a, scale, old_1, old_2, work)
        return 0.0, t1, t2
    open_1, open_2 = 0.0, 0.0
    if old_n <= 0.0:
        if a > 0.0:
            open_1, open_2 = _friction_alone(g, q1, q2, a, scale, old_1, old_2, work)
        if qn + g[1] * open_1 + g[2] * open_2 >= 0.0:
            return 0.0, open_1, open_2
    n0, h1, h2 = -qn / nn, g[1] / nn, g[2] / nn
    s11, s12, s21, s22 = g[4] - g[3] * h1, g[5] - g[3] * h2, g[7] - g[6] * h1, g[8] - g[6] * h2
    r1, r2 = q1 + g[3] * n0, q2 + g[6] * n0
    rounding = ROUNDING_TOLERANCE * max(abs(q1) + abs(g[3] * n0), abs(q2) + abs(g[6] * n0))
    n, t1, t2, is_consistent = _on_disc(
        s11, s12, s21, s22, r1, r2, n0, h1, h2, mu, a, scale, rounding, old_1, old_2, work
    )
    if is_consistent:
        return n, t1, t2
    if old_n > 0.0:
        if a > 0.0:
            open_1, open_2 = _friction_alone(g, q1, q2, a, scale, old_1, old_2, work)
        if qn + g[1] * open_1 + g[2] * open_2 >= 0.0:
            return 0.0, open_1, open_2
    # no state is consistent: choose the smallest violation among slip, open, and the current friction
    min_violation = spatial_violation(g, qn, q1, q2, mu, a, 0.0, open_1, open_2)
    current_n = max(n0 - h1 * old_1 - h2 * old_2, 0.0)
    bound, length = a + mu * current_n, np.sqrt(old_1 * old_1 + old_2 * old_2)
    shrink = bound / length if length > bound else 1.0
    current_violation = spatial_violation(g, qn, q1, q2, mu, a, current_n, old_1 * shrink, old_2 * shrink)
    if n >= 0.0:
        n, t1, t2, slip_violation = _slip_refined(g, qn, q1, q2, mu, a, n, t1, t2)
        if slip_violation < min(min_violation, current_violation):
            return n, t1, t2
    if current_violation < min_violation:
        return current_n, old_1 * shrink, old_2 * shrink
    return 0.0, open_1, open_2


@njit(cache=True, error_model="numpy")
def _slip_refined(g, qn, q1, q2, mu, a, n, t1, t2):  # type: ignore[no-untyped-def]
    """Refine a slip by Newton steps in Λ_N and its direction; return the impulse and its violation.

    Where 1 + μhᵀt nearly vanishes, a contact jams: its impulses are large, and rounding errors of Λ_N = n0 − hᵀΛ_T make
    them inconsistent.
    """
    min_violation = spatial_violation(g, qn, q1, q2, mu, a, n, t1, t2)
    for _ in range(REFINEMENTS):
        length = np.sqrt(t1 * t1 + t2 * t2)
        u, v, bound = t1 / length, t2 / length, a + mu * n
        x1 = g[3] * n + g[4] * t1 + g[5] * t2 + q1
        x2 = g[6] * n + g[7] * t1 + g[8] * t2 + q2
        rise, turn = _two_equations(
            g[0] + mu * (g[1] * u + g[2] * v),
            bound * (g[2] * u - g[1] * v),
            u * (g[6] + mu * (g[7] * u + g[8] * v)) - v * (g[3] + mu * (g[4] * u + g[5] * v)),
            bound * (u * (g[8] * u - g[7] * v) - v * (g[5] * u - g[4] * v)) - u * x1 - v * x2,
            g[0] * n + g[1] * t1 + g[2] * t2 + qn,
            u * x2 - v * x1,
        )
        new_n, cosine, sine = n + rise, np.cos(turn), np.sin(turn)
        new_bound = a + mu * new_n
        new_1, new_2 = new_bound * (u * cosine - v * sine), new_bound * (v * cosine + u * sine)
        violation = spatial_violation(g, qn, q1, q2, mu, a, new_n, new_1, new_2)
        if not (new_n >= 0.0 and violation < min_violation):
            break
        n, t1, t2, min_violation = new_n, new_1, new_2, violation
    return n, t1, t2, min_violation


@njit(cache=True, error_model="numpy")
def _friction_alone(g, q1, q2, a, scale, old_1, old_2, work):  # type: ignore[no-untyped-def]
    """Return Λ_T within the bound a for Λ_N = 0."""
    arguments = (g[4], g[5], g[7], g[8], q1, q2, 0.0, 0.0, 0.0, 0.0, a, scale, 0.0)
    _, t1, t2, _ = _on_disc(*arguments, old_1, old_2, work)
    return t1, t2


@njit(cache=True, error_model="numpy")
def _on_disc(  # type: ignore[no-untyped-def]
    s11, s12, s21, s22, r1, r2, n0, h1, h2, mu, a, scale, rounding, old_1, old_2, work
):
    """Return Λ in stick or slip, for ξ_T = S Λ_T + r and Λ_N = n0 − hᵀΛ_T, and whether it is consistent."""
    t1, t2, is_consistent = _stick(s11, s12, s21, s22, r1, r2, n0, h1, h2, mu, a, scale, rounding, old_1, old_2)
    if is_consistent:
        return n0 - h1 * t1 - h2 * t2, t1, t2, True
    b0 = a + mu * n0
    c0, c1, c2, c3, c4 = slip_polynomial(s11, s12, s21, s22, r1, r2, mu * h1, mu * h2, b0)
    x, y = initial_direction(old_1, old_2, r1, r2)
    u, v, converged = refine_direction(c0, c1, c2, c3, c4, x, y)
    if converged:
        n, t1, t2, slip_violation = _slip(s11, s12, s21, s22, r1, r2, n0, h1, h2, mu, a, u, v)
        if slip_violation <= 0.0:
            return n, t1, t2, True
    count = slip_directions(c0, c1, c2, c3, c4, work)
    best_n, best_1, best_2, nearest, has_consistent = -1.0, 0.0, 0.0, -2.0, False
    min_violation = np.inf
    for k in range(count):
        u, v, converged = refine_direction(c0, c1, c2, c3, c4, work[2 * k], work[2 * k + 1])
        n, t1, t2, slip_violation = _slip(s11, s12, s21, s22, r1, r2, n0, h1, h2, mu, a, u, v)
        is_consistent = converged and slip_violation <= 0.0
        if (is_consistent and (not has_consistent or u * x + v * y > nearest)) or (
            not has_consistent and slip_violation < min_violation
        ):
            best_n, best_1, best_2, nearest, min_violation = n, t1, t2, u * x + v * y, slip_violation
            has_consistent = has_consistent or is_consistent
    return best_n, best_1, best_2, has_consistent


@njit(cache=True, error_model="numpy")
def _slip(s11, s12, s21, s22, r1, r2, n0, h1, h2, mu, a, u, v):  # type: ignore[no-untyped-def]
    """Return Λ of slip with Λ_T along (u, v), and its violation [m/s]: ≤ 0 if it is consistent, inf if Λ_N < 0."""
    denominator = 1.0 + mu * (h1 * u + h2 * v)
    if denominator == 0.0:
        return -1.0, 0.0, 0.0, np.inf
    bound = (a + mu * n0) / denominator
    t1, t2 = bound * u, bound * v
    n = n0 - h1 * t1 - h2 * t2
    if not (bound >= 0.0 and n >= 0.0):
        return n, t1, t2, np.inf
    x, y = s11 * t1 + s12 * t2, s21 * t1 + s22 * t2
    along = (x + r1) * u + (y + r2) * v
    across = abs((y + r2) * u - (x + r1) * v)
    size = abs(x) + abs(y) + abs(r1) + abs(r2)
    return n, t1, t2, max(along, across) - ROUNDING_TOLERANCE * size


@njit(cache=True, error_model="numpy")
def _stick(s11, s12, s21, s22, r1, r2, n0, h1, h2, mu, a, scale, rounding, old_1, old_2):  # type: ignore[no-untyped-def]
    """Return Λ_T with S Λ_T + r = 0, and whether there is one with Λ_N ≥ 0 and ‖Λ_T‖ ≤ a + μΛ_N."""
    size = max(max(abs(s11), abs(s12)), max(abs(s21), abs(s22)))
    determinant = s11 * s22 - s12 * s21
    t1, t2 = old_1, old_2
    if size <= SINGULAR * scale:  # friction impulses cause no velocity
        if max(abs(r1), abs(r2)) > rounding:
            return 0.0, 0.0, False
        if n0 < 0.0:
            return 0.0, 0.0, False
        shrink, along = 1.0, h1 * t1 + h2 * t2  # shrink until Λ_N ≥ 0 and ‖Λ_T‖ ≤ a + μΛ_N
        growth = np.sqrt(t1 * t1 + t2 * t2) + mu * along
        if growth > a + mu * n0:
            shrink = (a + mu * n0) / growth
        if shrink * along > n0:
            shrink = n0 / along
        return shrink * t1, shrink * t2, True
    if abs(determinant) > SINGULAR * scale * size:
        t1, t2 = _two_equations(s11, s12, s21, s22, r1, r2)
        n = n0 - h1 * t1 - h2 * t2
        bound = a + mu * n
        return t1, t2, n >= 0.0 and t1 * t1 + t2 * t2 <= bound * bound
    return _stick_along_line(s11, s12, s21, s22, r1, r2, n0, h1, h2, mu, a, old_1, old_2)


@njit(cache=True, error_model="numpy")
def _two_equations(s11, s12, s21, s22, r1, r2):  # type: ignore[no-untyped-def]
    """Return x with S x + r = 0 by elimination with the largest entry as pivot.

    For any S, the error of the equations is as small as the rounding of their terms. With Cramer's rule, it would grow
    with the condition number of S.
    """
    if max(abs(s21), abs(s22)) > max(abs(s11), abs(s12)):
        s11, s12, r1, s21, s22, r2 = s21, s22, r2, s11, s12, r1
    is_swapped = abs(s12) > abs(s11)
    if is_swapped:
        s11, s12, s21, s22 = s12, s11, s22, s21
    factor = s21 / s11
    y = -(r2 - factor * r1) / (s22 - factor * s12)
    x = -(r1 + s12 * y) / s11
    return (y, x) if is_swapped else (x, y)


@njit(cache=True, error_model="numpy")
def _stick_along_line(s11, s12, s21, s22, r1, r2, n0, h1, h2, mu, a, old_1, old_2):  # type: ignore[no-untyped-def]
    """Return the result of ``_stick`` for S of rank one: Λ_T = x u + y v with S v = 0, where only x is determined."""
    if abs(s11) + abs(s12) >= abs(s21) + abs(s22):
        u1, u2 = s11, s12
    else:
        u1, u2 = s21, s22
    length = np.sqrt(u1 * u1 + u2 * u2)
    u1, u2 = u1 / length, u2 / length
    v1, v2 = -u2, u1
    w1, w2 = s11 * u1 + s12 * u2, s21 * u1 + s22 * u2
    x = -(w1 * r1 + w2 * r2) / (w1 * w1 + w2 * w2)
    if max(abs(r1 + w1 * x), abs(r2 + w2 * x)) > SINGULAR * max(abs(r1), abs(r2)):
        return 0.0, 0.0, False
    slope = -mu * (h1 * v1 + h2 * v2)  # derivative of the bound along v
    y, step = old_1 * v1 + old_2 * v2, 0.0
    for attempt in range(64):
        t1, t2 = x * u1 + y * v1, x * u2 + y * v2
        n = n0 - h1 * t1 - h2 * t2
        bound = a + mu * n
        if n >= 0.0 and bound >= 0.0 and x * x + y * y <= bound * bound * (1.0 + ROUNDING_TOLERANCE):
            return t1, t2, True
        if abs(slope) < 1.0:  # at the next y, the bound exceeds ‖Λ_T‖ most, if it does so anywhere
            if attempt > 0:
                break
            y = abs(x) * slope / np.sqrt(1.0 - slope * slope)
        else:  # the bound grows faster than ‖Λ_T‖, so it holds for large enough impulses along v
            step = max(2.0 * step, abs(x) + abs(n0) + a)
            y = step if slope > 0.0 else -step
    return 0.0, 0.0, False
