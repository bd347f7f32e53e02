"""Power series of the central path, from one factorisation and, for each order, one solution of a linear system.

Along the path every equation is at most quadratic in the unknowns (see ``cones``),

    p ∘ q = τ e,      s² = ‖û_T‖²,      û = Ĝr + ĉ + s e_N,

so that, with x(a) = Σ x_k aᵏ, each order follows from the lower ones by the linear system of Newton's method at a = 0
(Cochelin 1994). With ζ = û_{T,0}/s₀, the equations of order k are

    L(p₀) q_k + L(q₀) p_k = τ_k e − Σ_{0<j<k} p_j ∘ q_{k−j},
    s_k = ζᵀ û_{T,k} + (Σ_{0<j<k} û_{T,j}ᵀ û_{T,k−j} − s_j s_{k−j}) / 2s₀.

The parameter a is arc length, so τ need not be monotone: ⟨x₁, x₁⟩ = 1 and ⟨x₁, x_k⟩ = 0. The metric is local,

    ⟨x, y⟩ = Σ xᵀQ_p⁻¹y + xᵀQ_q⁻¹y over all cones + τ_x τ_y/τ²,

with the quadratic representation Q of the Jordan product. The metric is invariant under scaling of the contacts and of
the problem.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from ...problems.arrays import FloatArray
from .cones import BOTH, CONE, DISC, NORMAL, determinant, divide_by_arrow, dot_tangential, tangential_length


@dataclass(frozen=True, eq=False)
class Direction:
    """A direction in the unknowns.

    Attributes:
        r: change of r, shape (m, w): m cones with w lanes each.
        u: change of û, shape (m, w).
        s: change of s, shape (m,).
        tau: change of τ, relative to τ.
    """

    r: FloatArray
    u: FloatArray
    s: FloatArray
    tau: float

    def plus(self, weight: float, other: "Direction") -> "Direction":
        """Return this direction plus ``weight`` times another."""
        return Direction(
            self.r + weight * other.r,
            self.u + weight * other.u,
            self.s + weight * other.s,
            self.tau + weight * other.tau,
        )

    def times(self, factor: float) -> "Direction":
        """Return ``factor`` times this direction."""
        return Direction(factor * self.r, factor * self.u, factor * self.s, factor * self.tau)


@njit(cache=True, error_model="numpy")
def write_lower_orders(kind, friction, r, u, s, order, complementarity_terms, lift_terms):  # type: ignore[no-untyped-def]
    """Write the sums over lower orders in the equations of order k, for each of m cones of w lanes.

    ``complementarity_terms`` receives −Σ p_j∘q_{k−j} and, in its last column, −Σ r_j û_{k−j} of normal laws, shape
    (m, w + 1).
    ``lift_terms`` receives the sum in s_k divided by 2s₀, shape (m,).
    """
    width = r.shape[2]
    for i in range(len(kind)):
        complementarity_terms[i] = 0.0
        lift_terms[i] = 0.0
        for j in range(1, order):
            k = order - j
            if kind[i] == NORMAL or kind[i] == BOTH:
                complementarity_terms[i, width] -= r[j, i, 0] * u[k, i, 0]
            if kind[i] < CONE:
                continue
            if kind[i] == CONE:
                p, q, p_other, q_other = r[j, i, 0], u[k, i, 0], r[k, i, 0], u[j, i, 0]
            else:
                p, q, p_other, q_other = friction[i] * r[j, i, 0], s[k, i], friction[i] * r[k, i, 0], s[j, i]
            complementarity_terms[i, 0] -= p * q + dot_tangential(r[j, i], u[k, i])
            for lane in range(1, width):
                complementarity_terms[i, lane] -= p_other * u[j, i, lane] + q_other * r[k, i, lane]
            if kind[i] == CONE:
                lift_terms[i] += dot_tangential(u[j, i], u[k, i]) - s[j, i] * s[k, i]
        if lift_terms[i] != 0.0:
            lift_terms[i] = lift_terms[i] / (2.0 * s[0, i]) if s[0, i] > 0.0 else 0.0


@njit(cache=True, error_model="numpy")
def write_right_side(kind, p, r, u, complementarity_terms, lift_terms, shifts, right):  # type: ignore[no-untyped-def]
    """Write L(p)⁻¹ ``complementarity_terms`` to ``shifts``, and the right-hand side of the system to ``right``."""
    width = r.shape[1]
    for i in range(len(kind)):
        shifts[i] = 0.0
        right[i] = 0.0
        if kind[i] == NORMAL or kind[i] == BOTH:
            right[i, 0] = complementarity_terms[i, width] / r[i, 0]
        if kind[i] < CONE:
            continue
        for lane in range(width):
            shifts[i, lane] = complementarity_terms[i, lane]
        divide_by_arrow(p[i], shifts[i])
        for lane in range(1, width):
            right[i, lane] = shifts[i, lane]
        if kind[i] == CONE:
            length = tangential_length(u[i])
            along = dot_tangential(u[i], shifts[i]) / length if length > 0.0 else 0.0
            right[i, 0] = shifts[i, 0] - along - lift_terms[i]


@njit(cache=True, error_model="numpy")
def _metric_product(p, x0, x, y0, y):  # type: ignore[no-untyped-def]
    """Return (x₀, x̄)ᵀ Q_p⁻¹ (y₀, ȳ)."""
    det = determinant(p)
    along_x, along_y = p[0] * x0 - dot_tangential(p, x), p[0] * y0 - dot_tangential(p, y)
    return 2.0 * (along_x / det) * (along_y / det) - (x0 * y0 - dot_tangential(x, y)) / det


@njit(cache=True, error_model="numpy")
def local_product(kind, friction, p, q, r, u, r_x, u_x, s_x, r_y, u_y, s_y):  # type: ignore[no-untyped-def]
    """Return ⟨x, y⟩ without its part in τ."""
    total = 0.0
    for i in range(len(kind)):
        if kind[i] == NORMAL or kind[i] == BOTH:
            total += r_x[i, 0] * r_y[i, 0] / r[i, 0] ** 2 + u_x[i, 0] * u_y[i, 0] / u[i, 0] ** 2
        if kind[i] < CONE:
            continue
        p_x, q_x, p_y, q_y = r_x[i, 0], u_x[i, 0], r_y[i, 0], u_y[i, 0]
        if kind[i] >= DISC:
            p_x, q_x, p_y, q_y = friction[i] * p_x, s_x[i], friction[i] * p_y, s_y[i]
        total += _metric_product(p[i], p_x, r_x[i], p_y, r_y[i])
        total += _metric_product(q[i], q_x, u_x[i], q_y, u_y[i])
    return total


class Series:
    """x(a) = Σ x_k aᵏ of r, û and s, and τ(a) = τ₀ Σ t_k aᵏ, from the point of the path at a = 0."""

    def __init__(self, order: int, r: FloatArray, u: FloatArray, s: FloatArray) -> None:
        self.r: FloatArray = np.zeros((order + 1, *r.shape))
        self.u: FloatArray = np.zeros((order + 1, *u.shape))
        self.s: FloatArray = np.zeros((order + 1, *s.shape))
        self.tau: FloatArray = np.zeros(order + 1)
        self.r[0], self.u[0], self.s[0], self.tau[0] = r, u, s, 1.0

    def put(self, order: int, direction: Direction) -> None:
        """Store the coefficients of an order."""
        self.r[order], self.u[order], self.s[order] = direction.r, direction.u, direction.s
        self.tau[order] = direction.tau

    def tau_at(self, a: float) -> float:
        """Return τ(a)/τ₀."""
        return float(np.polynomial.polynomial.polyval(a, self.tau))

    def manifold_vector(self, a: float) -> FloatArray:
        """Return v = r − û at a, shape (m, w)."""
        vector: FloatArray = np.tensordot(np.power(a, np.arange(len(self.tau))), self.r - self.u, 1)
        return vector
