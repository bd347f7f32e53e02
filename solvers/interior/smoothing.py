"""Smoothed projection onto cones: from any vector to impulses and velocities on the central manifold.

For every v, exactly one pair r, û inside the cone has v = r − û and r ∘ û = τ e; r and û share the Jordan frame of v:

    r = ½ (v + √(v² + 4τ e)),      û = r − v                  (Fukushima, Luo & Tseng 2001),

and for τ → 0, they tend to the projections of v and −v onto the cone. Complementarity thus holds by construction, and
the problem becomes a system of equations in v without boundaries. A start Λ gives v = r(Λ) − û(Λ).

A disc of radius b has (b, r_T) ∘ (s, û_T) = τ e with r_T and û_T along v_T: s = τb/(b² − r²) and
û_T = −τ r_T/(b² − r²), where r = ‖r_T‖ is the only root of r + τr/(b² − r²) = ‖v_T‖ below b. A joint has r = v and
û = 0.
"""

import numpy as np
from numba import njit

from ...problems.arrays import FloatArray
from .cones import BOTH, CONE, DISC, JOINT, NORMAL, tangential_length

MAX_STEPS = 60
"""Largest number of safeguarded Newton steps for the radius in a disc."""


@njit(cache=True, error_model="numpy")
def rounded_positive_part(x, tau):  # type: ignore[no-untyped-def]
    """Return ½ (x + √(x² + 4τ)) without cancellation."""
    root = np.sqrt(x * x + 4.0 * tau)
    return 0.5 * (x + root) if x >= 0.0 else 2.0 * tau / (root - x)


@njit(cache=True, error_model="numpy")
def radius_in_disc(length, bound, tau):  # type: ignore[no-untyped-def]
    """Return r in [0, b) with r + τr/(b² − r²) = length, and b − r, without cancellation."""
    half = 0.5 * bound
    if half * (1.0 + tau / (half * 1.5 * bound)) < length:
        gap = _gap_in_disc(length, bound, tau)
        return bound - gap, gap
    # the equation is convex and increasing in r, so Newton's method converges to its root from above
    radius = min(half, length / (1.0 + tau / (bound * bound)))
    for _ in range(MAX_STEPS):
        margin = (bound - radius) * (bound + radius)
        value = radius * (1.0 + tau / margin) - length
        next_radius = radius - value / (1.0 + tau / margin + 2.0 * tau * (radius / margin) ** 2)
        if not abs(next_radius - radius) > 1e-15 * radius:
            break
        radius = next_radius
    return radius, bound - radius


@njit(cache=True, error_model="numpy")
def _gap_in_disc(length, bound, tau):  # type: ignore[no-untyped-def]
    """Return y = b − r below ½b with (b − y)(1 + τ/(y(2b − y))) = ``length``; the left side decreases in y."""
    low, high = 0.0, 0.5 * bound
    excess = length - bound
    y = min(high, 0.5 * tau / excess) if excess > 0.0 else high
    for _ in range(MAX_STEPS):
        wide = 2.0 * bound - y
        weight = tau / (y * wide)
        value = (bound - y) * (1.0 + weight) - length
        if value > 0.0:
            low = y
        else:
            high = y
        next_y = y + value / (1.0 + weight + (bound - y) * weight * (1.0 / y - 1.0 / wide))
        if not low < next_y < high:
            next_y = np.sqrt(low * high) if low > 0.0 else 0.1 * high
        if not abs(next_y - y) > 1e-15 * y:
            break
        y = next_y
    return y


@njit(cache=True, error_model="numpy")
def split(kind, fixed_bound, friction, tau, v, r, u, slack):  # type: ignore[no-untyped-def]
    """Write r, û and s from v, with r∘û = τ e in every cone; s is ‖û_T‖ in De Saxcé's term."""
    for i in range(len(kind)):
        r[i] = 0.0
        u[i] = 0.0
        slack[i] = 0.0
        length = tangential_length(v[i])
        if kind[i] == JOINT:
            r[i, 0] = v[i, 0]
        if kind[i] == NORMAL or kind[i] == BOTH:
            r[i, 0], u[i, 0] = rounded_positive_part(v[i, 0], tau), rounded_positive_part(-v[i, 0], tau)
        if kind[i] == CONE:
            upper, lower = v[i, 0] + length, v[i, 0] - length
            r_upper, r_lower = rounded_positive_part(upper, tau), rounded_positive_part(lower, tau)
            u_upper, u_lower = rounded_positive_part(-upper, tau), rounded_positive_part(-lower, tau)
            r[i, 0], u[i, 0] = 0.5 * (r_upper + r_lower), 0.5 * (u_upper + u_lower)
            if length > 0.0:
                along_r, along_u = 0.5 * (r_upper - r_lower) / length, 0.5 * (u_upper - u_lower) / length
                for lane in range(1, v.shape[1]):
                    r[i, lane], u[i, lane] = along_r * v[i, lane], along_u * v[i, lane]
                slack[i] = abs(along_u) * length
        if kind[i] >= DISC:
            bound = fixed_bound[i] + friction[i] * r[i, 0]
            radius, gap = radius_in_disc(length, bound, tau)
            weight = tau / (gap * (bound + radius))
            slack[i] = weight * bound
            if length > 0.0:
                for lane in range(1, v.shape[1]):
                    r[i, lane] = radius / length * v[i, lane]
                    u[i, lane] = -weight * r[i, lane]


def on_manifold(
    kind: np.ndarray, fixed_bound: FloatArray, friction: FloatArray, tau: float, v: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return r and û, shape (m, w), and s, shape (m,), from v, shape (m, w), at τ > 0."""
    r, u, slack = np.empty_like(v), np.empty_like(v), np.empty(len(v))
    split(kind, fixed_bound, friction, tau, v, r, u, slack)
    return r, u, slack
