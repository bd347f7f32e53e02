"""All directions in which one spatial contact can slip.

In a closed contact, ξ_N = 0 gives Λ_N = n_0 − hᵀΛ_T. The tangential velocity is then ξ_T = S Λ_T + r, and the friction
bound is b = a + μ(n_0 − hᵀΛ_T). In slip, Λ_T = b t with t = (cos θ, sin θ), which gives b = b_0/(1 + μhᵀt) with
b_0 = a + μn_0. Slip requires a ξ_T parallel to t, so that the scalar cross product t × ξ_T vanishes:

    f(θ) = b_0 t × S t + (1 + μhᵀt) t × r = A cos²θ + B cosθ sinθ + C sin²θ + D cosθ + E sinθ = 0.

This is a quartic equation in tan(θ/2) with at most four solutions (Bonnefon & Daviet, Quartic formulation of Coulomb 3D
frictional contact, 2011). Newton's method from the current direction almost always finds the required solution.
Otherwise all zeros of the quartic are bracketed between the zeros of its derivatives. For a friction law with a fixed
bound a, such as that of an open contact, μ, n_0 and h are zero.
"""

import numpy as np
from numba import njit

MAX_NEWTON_STEPS = 12
"""Largest number of Newton steps from a direction; three or four suffice near a solution."""

N_POLE_CANDIDATES = 8
"""Number of candidates for the pole of tan(θ/2); the best has the largest |f|, which is the leading coefficient."""

MAX_BRACKET_STEPS = 120
"""Largest number of steps of one bracketed search; even bisection needs fewer to converge up to rounding."""

WORKSPACE_SIZE = 16
"""Number of entries of the workspace of ``slip_directions``."""


@njit(cache=True, inline="always")
def slip_polynomial(s11, s12, s21, s22, r1, r2, m1, m2, b0):  # type: ignore[no-untyped-def]
    """Return the coefficients A, B, C, D and E of f; (m1, m2) is μh."""
    return (
        b0 * s21 + m1 * r2,
        b0 * (s22 - s11) + m2 * r2 - m1 * r1,
        -b0 * s12 - m2 * r1,
        r2,
        -r1,
    )


@njit(cache=True, inline="always", error_model="numpy")
def initial_direction(t1, t2, r1, r2):  # type: ignore[no-untyped-def]
    """Return the unit vector along the current Λ_T; along −r if Λ_T is zero, and (1, 0) if both are zero."""
    x, y = 1.0, 0.0
    length, speed = np.sqrt(t1 * t1 + t2 * t2), np.sqrt(r1 * r1 + r2 * r2)
    if length > 0.0:
        x, y = t1 / length, t2 / length
    elif speed > 0.0:
        x, y = -r1 / speed, -r2 / speed
    return x, y


@njit(cache=True, error_model="numpy")
def refine_direction(a, b, c, d, e, x, y):  # type: ignore[no-untyped-def]
    """Rotate the unit vector (x, y) to a zero of f by Newton's method; return it, and whether the method converged."""
    converged = False
    size = abs(a) + abs(b) + abs(c) + abs(d) + abs(e)
    for _ in range(MAX_NEWTON_STEPS):
        f = (a * x + b * y + d) * x + (c * y + e) * y
        slope = 2.0 * (c - a) * x * y + b * (x * x - y * y) + e * x - d * y
        if abs(f) <= 4e-16 * size:
            converged = True
            break
        if not abs(f) < 0.5 * abs(slope):
            break
        angle = -f / slope
        x, y = x - angle * y, y + angle * x
        scale = 1.0 / np.sqrt(x * x + y * y)
        x *= scale
        y *= scale
        if abs(angle) <= 1e-15:
            converged = True
            break
    return x, y, converged


@njit(cache=True, error_model="numpy")
def slip_directions(a, b, c, d, e, work):  # type: ignore[no-untyped-def]
    """Write the directions of all zeros and extrema of f to ``work``; return their number, at most seven.

    Direction k is ``(work[2 * k], work[2 * k + 1])``, the cosine and the sine of θ. There is none if f is zero
    everywhere.
    """
    cos_pole, sin_pole, best = 1.0, 0.0, -1.0
    for k in range(N_POLE_CANDIDATES):
        x, y = np.cos(2.0 * np.pi * k / N_POLE_CANDIDATES), np.sin(2.0 * np.pi * k / N_POLE_CANDIDATES)
        value = abs((a * x + b * y + d) * x + (c * y + e) * y)
        if value > best:
            cos_pole, sin_pole, best = x, y, value
    if best == 0.0:
        return 0
    # in rotated axes (p, q) and (−q, p), the pole lies at θ = π, where tan(θ/2) is infinite
    p, q = -cos_pole, -sin_pole
    ta = a * p * p + b * p * q + c * q * q
    tb = -2.0 * a * p * q + b * (p * p - q * q) + 2.0 * c * p * q
    tc = a * q * q - b * p * q + c * p * p
    td = d * p + e * q
    te = -d * q + e * p
    p0, p1, p2, p3, p4 = ta + td, 2.0 * (tb + te), 4.0 * tc - 2.0 * ta, 2.0 * (te - tb), ta - td
    n = _quartic_roots(p0 / p4, p1 / p4, p2 / p4, p3 / p4, work)
    for k in range(n - 1, -1, -1):  # backwards, because each pair overwrites two roots
        t = work[k]
        u, v = (1.0 - t * t) / (1.0 + t * t), 2.0 * t / (1.0 + t * t)
        work[2 * k], work[2 * k + 1] = u * p - v * q, u * q + v * p
    return n


@njit(cache=True, error_model="numpy")
def _quartic_roots(p0, p1, p2, p3, work):  # type: ignore[no-untyped-def]
    """Write the real zeros of x⁴ + p3 x³ + p2 x² + p1 x + p0 and of its derivative to ``work``; return their number.

    Entries of ``work`` from the ninth on are scratch space.
    """
    bound = 1.0 + max(max(abs(p0), abs(p1)), max(abs(p2), abs(p3)))
    # inflection points, zeros of 6x² + 3 p3 x + p2, separate the extrema
    discriminant = 9.0 * p3 * p3 - 24.0 * p2
    n_ends = 0
    if discriminant > 0.0:
        root = np.sqrt(discriminant)
        work[8], work[9] = (-3.0 * p3 - root) / 12.0, (-3.0 * p3 + root) / 12.0
        n_ends = 2
    n_extrema = _zeros_between(p1, 2.0 * p2, 3.0 * p3, 4.0, 0.0, bound, work[8 : 8 + n_ends], work[10:])
    n = _zeros_between(p0, p1, p2, p3, 1.0, bound, work[10 : 10 + n_extrema], work)
    for k in range(n_extrema):
        work[n] = work[10 + k]
        n += 1
    return n


@njit(cache=True, error_model="numpy")
def _zeros_between(p0, p1, p2, p3, p4, bound, ends, zeros):  # type: ignore[no-untyped-def]
    """Write zeros of p4 x⁴ + … + p0, at most one per interval, to ``zeros``; return their number.

    The intervals lie between −``bound``, the ascending ``ends`` and ``bound``.
    """
    n, low = 0, -bound
    for k in range(len(ends) + 1):
        high = ends[k] if k < len(ends) else bound
        has_zero, x = _zero_between(p0, p1, p2, p3, p4, low, high)
        if has_zero:
            zeros[n] = x
            n += 1
        low = high
    return n


@njit(cache=True, error_model="numpy")
def _zero_between(p0, p1, p2, p3, p4, low, high):  # type: ignore[no-untyped-def]
    """Return whether p4 x⁴ + … + p0 changes sign from ``low`` to ``high``, and a zero, by bracketed Newton steps."""
    at_low = (((p4 * low + p3) * low + p2) * low + p1) * low + p0
    at_high = (((p4 * high + p3) * high + p2) * high + p1) * high + p0
    if at_low == 0.0:
        return True, low
    if not at_low * at_high < 0.0:
        return False, 0.0
    is_increasing = at_high > 0.0
    x = 0.5 * (low + high)
    for _ in range(MAX_BRACKET_STEPS):
        value = (((p4 * x + p3) * x + p2) * x + p1) * x + p0
        if value == 0.0:
            break
        if (value > 0.0) == is_increasing:
            high = x
        else:
            low = x
        slope = ((4.0 * p4 * x + 3.0 * p3) * x + 2.0 * p2) * x + p1
        guess = x - value / slope if slope != 0.0 else low
        if not low < guess < high:
            guess = 0.5 * (low + high)
        if guess == x or high - low <= 4e-16 * max(abs(low), abs(high)):
            break
        x = guess
    return True, x
