"""The projection equations of a contact problem, and their linearisation, the system of a semismooth Newton step.

The inclusion of law i is Λ_i = prox_{C_i}(x_i), x_i = Λ_i − ξ_i/α_i, where α_i is the largest diagonal entry of its
block, as in the judge. The state of the law is the piece of the prox on which x_i lies (Alart & Curnier, A mixed
formulation for frictional contact problems prone to Newton like solution methods, 1991); b = a + μΛ_N is its bound:

    open    x_N ≤ 0         Λ_N = 0
    closed  x_N > 0         ξ_N = 0
    stick   ‖x_T‖ ≤ b       ξ_T = 0
    slip    ‖x_T‖ > b       Λ_T = b t,  t = x_T/‖x_T‖
    idle    b = 0           Λ_T = 0

Rolling friction has the states of sliding friction, with its own rows and bound. A bilateral law is always closed.
Open and idle rows are not in the system. On the other rows, the step δ satisfies ξ + Gδ = 0 if the law is closed or
sticks. With κ = b/‖x_T‖ and P = κ(I − t tᵀ), the equation, multiplied by α, is

    P (Gδ)_T + α(I − P) δ_T − αμ t δ_N = α(b t − Λ_T)            if it slips.

Small systems are assembled as dense matrices, because sparse systems of the same size take ten times as long.
"""

from copy import copy
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numba import njit

from ...problems.arrays import FloatArray, IntArray
from ...problems.contact.laws import BALL, HALF_LINE, LINE
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual

MAX_DENSE_ROWS = 150
"""Largest number of rows of a dense system; its factorisation takes less time than the overhead of a sparse one."""


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """The system of one Newton step: Λ = base + δ on active rows, δ = 0 on the other rows.

    Attributes:
        base: Λ with open and idle rows set to zero [N s], shape (n_rows,).
        active: the remaining rows, shape (n_active,).
        matrix: the Jacobian over active rows [1/kg], shape (n_active, n_active); dense or sparse.
        right: the right-hand side [m/s], shape (n_active,).
    """

    base: FloatArray
    active: IntArray
    matrix: FloatArray | sp.csr_array
    right: FloatArray


class Equations:
    """The projection equations of one problem.

    Attributes:
        problem: the problem.
        residual: its residual.
        row_alpha: α of the law of each row [1/kg], shape (n_rows,).
        entries: number of stored entries of G.
    """

    def __init__(self, problem: ContactProblem, residual: Residual) -> None:
        self.problem, self.residual, laws = problem, residual, problem.laws
        self._delassus, self._free = problem.delassus(), problem.free_velocity
        self.entries = int(self._delassus.nnz)
        self._dense = self._delassus.toarray() if problem.n_rows <= MAX_DENSE_ROWS else None
        self.row_alpha: FloatArray = np.repeat(residual.alpha, laws.row_count)
        partner_row = np.where(laws.partner >= 0, laws.first_row[laws.partner], -1)
        friction = laws.friction_coefficient, laws.fixed_bound
        self._laws = (laws.sets, laws.first_row, laws.row_count, *friction, partner_row)
        self._alpha = residual.alpha

    def regularised(self, weight: float, centre: FloatArray) -> "Equations":
        """Return the equations with a proximal term, ξ = GΛ + c + weight · α (Λ − centre), all of shape (n_rows,)."""
        other = copy(self)
        proximal = weight * self.row_alpha
        other._delassus = sp.csr_array(self._delassus + sp.diags_array(proximal))
        other._dense = None if self._dense is None else other._delassus.toarray()
        other._free = self._free - proximal * centre
        other._alpha, other.row_alpha = (1.0 + weight) * self._alpha, (1.0 + weight) * self.row_alpha
        return other

    def velocity(self, impulses: FloatArray) -> FloatArray:
        """Return ξ = GΛ + c over rows."""
        return np.asarray(self._delassus @ impulses + self._free)

    def linearise(self, impulses: FloatArray) -> LinearSystem:
        """Return the system of the Newton step from Λ, shape (n_rows,)."""
        n_rows = len(self._free)
        base, right = impulses.copy(), np.zeros(n_rows)
        is_active, slips = np.zeros(n_rows, dtype=np.bool_), np.zeros(n_rows, dtype=np.bool_)
        pairs, weights = np.empty((2, 4 * n_rows), dtype=np.int64), np.empty((2, 4 * n_rows))
        count = _linearise(
            *self._laws, self._alpha, self.velocity(impulses), base, right, is_active, slips, pairs, weights
        )
        active = np.flatnonzero(is_active)
        right = np.where(slips, right, -self.velocity(base))[active]
        column = np.full(n_rows, -1)
        column[active] = np.arange(len(active))
        pairs, weights = column[pairs[:, :count]], weights[:, :count]
        if self._dense is not None:
            return LinearSystem(base, active, _jacobian(self._dense, active, slips[active], pairs, weights), right)
        matrix = sp.csr_array(self._delassus[active][:, active])
        if count > 0:
            rows, columns = pairs
            velocity_weights, impulse_weights = (
                sp.csr_array((values, (rows, columns)), shape=matrix.shape) for values in weights
            )
            identity = sp.diags_array(np.where(slips[active], 0.0, 1.0))
            matrix = sp.csr_array((velocity_weights + identity) @ matrix + impulse_weights)
        return LinearSystem(base, active, matrix, right)


@njit(cache=True)
def _jacobian(delassus, active, slips, pairs, weights):  # type: ignore[no-untyped-def]
    """Return the dense Jacobian over active rows: rows of G or, where a law slips, of P G plus the weights of δ."""
    n = len(active)
    matrix = np.zeros((n, n))
    for row in range(n):
        if not slips[row]:
            for lane in range(n):
                matrix[row, lane] = delassus[active[row], active[lane]]
    for entry in range(pairs.shape[1]):
        row, column = pairs[0, entry], pairs[1, entry]
        if weights[0, entry] != 0.0:
            for lane in range(n):
                matrix[row, lane] += weights[0, entry] * delassus[active[column], active[lane]]
        matrix[row, column] += weights[1, entry]
    return matrix


@njit(cache=True)
def _linearise(  # type: ignore[no-untyped-def]
    sets,
    first_row,
    rows,
    friction,
    fixed_bound,
    partner_row,
    alpha,
    velocity,
    base,
    right,
    is_active,
    slips,
    pairs,
    weights,
):
    """Identify the states, set Λ of open and idle rows to zero, and write the right-hand side and weights of slip."""
    for law in range(len(sets)):
        if sets[law] == LINE:
            is_active[first_row[law]] = alpha[law] > 0.0
        if sets[law] == HALF_LINE:
            i = first_row[law]
            is_active[i] = alpha[law] * base[i] > velocity[i] and alpha[law] > 0.0
            if not is_active[i]:
                base[i] = 0.0
    count = 0
    for law in range(len(sets)):
        if sets[law] != BALL:
            continue
        i, n, width = first_row[law], partner_row[law], rows[law]
        mu = friction[law] if n >= 0 and is_active[n] else 0.0
        bound = fixed_bound[law] + (mu * max(base[n], 0.0) if n >= 0 else 0.0)
        if bound <= 0.0 and mu == 0.0:
            base[i : i + width] = 0.0
            continue
        if alpha[law] <= 0.0:
            continue  # impulses of this law cause no velocity and stay unchanged
        is_active[i : i + width] = True
        argument = base[i : i + width] - velocity[i : i + width] / alpha[law]
        length = np.sqrt((argument**2).sum())
        if length <= bound:
            continue
        along, kappa = argument / length, bound / length
        for row in range(width):
            slips[i + row] = True
            right[i + row] = alpha[law] * (bound * along[row] - base[i + row])
            for lane in range(width):
                unit = 1.0 if row == lane else 0.0
                across = kappa * (unit - along[row] * along[lane])
                pairs[0, count], pairs[1, count] = i + row, i + lane
                weights[0, count], weights[1, count] = across, alpha[law] * (unit - across)
                count += 1
            if mu > 0.0:
                pairs[0, count], pairs[1, count] = i + row, n
                weights[0, count], weights[1, count] = 0.0, -alpha[law] * mu * along[row]
                count += 1
    return count
