"""Solution of one contact with rolling friction, with all other impulses fixed.

A contact with block G and velocity q from all other impulses has the laws

    0 ≤ Λ_N ⊥ ξ_N ≥ 0,   −ξ_T ∈ N(Λ_T) of the disc ‖Λ_T‖ ≤ a + μΛ_N,   −ξ_R ∈ N(Λ_R) of the ball ‖Λ_R‖ ≤ a_r + μ_rΛ_N

with ξ = GΛ + q. Two laws may slip simultaneously in independent directions. The states can therefore not be enumerated
as for contacts without rolling friction (``one_contact``). Newton's method with a line search on the projection
equations Λ_i = prox(Λ_i − ξ_i/α_i) almost always finds the solution from the current impulse. Otherwise projected
sweeps over the three laws follow, and Newton's method restarts. The result is the admissible impulse with the smallest
violation, as the judge measures it; it may be the current impulse.

Rolling rows are scaled by the length √(α_N/α_R), so that all rows are velocities and all impulses have one unit.
"""

import numpy as np
from numba import njit

from ...problems.compilation.kernel_arrays import copy_entries
from .any_laws import project_into_ball

MAX_STARTS = 4
"""Largest number of starts of Newton's method."""

MAX_NEWTON_STEPS = 25
"""Largest number of Newton steps per start."""

SWEEPS = 40
"""Number of projected sweeps between two starts."""

ROUNDING = 1e-14
"""Violations below this fraction of the free velocity count as zero."""

MIN_STEP = 1.0 / 64.0
"""The smallest fraction of a Newton step that the line search tries."""

PIVOT = 1e-13
"""A pivot below this fraction of the largest entry of its system counts as zero."""


@njit(cache=True, error_model="numpy")
def solve_rolling(block, q, sliding, mu, a, mu_r, a_r, impulse):  # type: ignore[no-untyped-def]
    """Replace the current ``impulse`` of a contact [N s], shape (d,), by the solution.

    ``block`` is G [1/kg], shape (d, d), and ``q`` is the velocity without the contact's own impulse [m/s], shape (d,).
    The lanes are N, then ``sliding`` lanes of T, then R with impulses [N m s] and angular velocities [rad/s]. ``a``
    [N s], ``mu_r`` [m] and ``a_r`` [N m s] are those of the laws above.
    """
    d = len(q)
    first = 1 + sliding
    largest = 0.0
    for k in range(first, d):
        largest = max(largest, block[k, k])
    length = np.sqrt(block[0, 0] / largest) if block[0, 0] > 0.0 and largest > 0.0 else 1.0
    g, free_velocity, x = np.empty((d, d)), np.empty(d), np.empty(d)
    for k in range(d):
        unit = length if k >= first else 1.0
        free_velocity[k], x[k] = unit * q[k], impulse[k] / unit
        for j in range(d):
            g[k, j] = unit * block[k, j] * (length if j >= first else 1.0)
    laws = (mu, a, mu_r / length, a_r / length)
    if not (x[0] <= 0.0 and a == 0.0 and a_r == 0.0 and free_velocity[0] >= 0.0):
        _solve(g, free_velocity, sliding, laws, x)
    else:
        x[:] = 0.0
    for k in range(d):
        impulse[k] = x[k] * (length if k >= first else 1.0)


@njit(cache=True, error_model="numpy")
def _solve(g, q, sliding, laws, x):  # type: ignore[no-untyped-def]
    """Replace Λ in ``x`` by the solution, with scaled rolling rows; ``laws`` holds μ, a, and scaled μ_r and a_r."""
    d = len(q)
    alpha = _curvatures(g, sliding)
    speed = 0.0
    for k in range(d):
        speed = max(speed, abs(q[k]))
    xi, best, trial = np.empty(d), np.empty(d), np.empty(d)
    system = np.empty((d, d + 1))
    _project(sliding, laws, x)
    copy_entries(x, best)
    best_violation = _violation(g, q, sliding, laws, alpha, x, xi)
    if x[0] <= 0.0 and g[0, 0] > 0.0:
        x[0] = max(-q[0] / g[0, 0], 0.0)
    for attempt in range(MAX_STARTS):
        if attempt > 0:
            copy_entries(best, x)
            _sweep(SWEEPS, g, q, sliding, laws, alpha, x, xi, trial)
        violation = _violation(g, q, sliding, laws, alpha, x, xi)
        for _ in range(MAX_NEWTON_STEPS):
            if violation < best_violation:
                copy_entries(x, best)
                best_violation = violation
            if best_violation <= ROUNDING * speed:
                break
            _linearise(g, q, sliding, laws, alpha, x, xi, system)
            if not _solve_linear_system(system):
                break
            fraction, old_violation = 1.0, violation
            while True:
                for k in range(d):
                    trial[k] = x[k] + fraction * system[k, d]
                violation = _violation(g, q, sliding, laws, alpha, trial, xi)
                if violation < (1.0 - 1e-4 * fraction) * old_violation or fraction <= MIN_STEP:
                    break
                fraction *= 0.5
            copy_entries(trial, x)
        _project(sliding, laws, x)
        violation = _violation(g, q, sliding, laws, alpha, x, xi)
        if violation < best_violation:
            copy_entries(x, best)
            best_violation = violation
        if best_violation <= ROUNDING * speed:
            break
    copy_entries(best, x)
    _project(sliding, laws, x)


@njit(cache=True, error_model="numpy")
def _curvatures(g, sliding):  # type: ignore[no-untyped-def]
    """Return α of the normal, sliding and rolling law, as a vector."""
    alpha = np.zeros(3)
    for k in range(len(g)):
        law = 0 if k == 0 else (1 if k <= sliding else 2)
        alpha[law] = max(alpha[law], g[k, k])
    return alpha


@njit(cache=True, error_model="numpy")
def _lanes_of(law, sliding, d):  # type: ignore[no-untyped-def]
    """Return the first lane of the sliding (1) or rolling (2) law, and the lane after its last one."""
    return (1, 1 + sliding) if law == 1 else (1 + sliding, d)


@njit(cache=True, error_model="numpy")
def _project(sliding, laws, x):  # type: ignore[no-untyped-def]
    """Project Λ onto its bounds, Λ_N first."""
    x[0] = max(x[0], 0.0)
    for law in (1, 2):
        begin, end = _lanes_of(law, sliding, len(x))
        bound, squared = laws[2 * law - 1] + laws[2 * law - 2] * x[0], 0.0
        for k in range(begin, end):
            squared += x[k] ** 2
        if squared > bound * bound:
            for k in range(begin, end):
                x[k] *= bound / np.sqrt(squared)


@njit(cache=True, error_model="numpy")
def _violation(g, q, sliding, laws, alpha, x, xi):  # type: ignore[no-untyped-def]
    """Write ξ; return the largest violation of the three laws [m/s], as the judge measures it."""
    d = len(q)
    for k in range(d):
        xi[k] = q[k]
        for j in range(d):
            xi[k] += g[k, j] * x[j]
    largest = abs(alpha[0] * x[0] - max(alpha[0] * x[0] - xi[0], 0.0))
    for law in (1, 2):
        begin, end = _lanes_of(law, sliding, d)
        bound, squared = alpha[law] * (laws[2 * law - 1] + laws[2 * law - 2] * max(x[0], 0.0)), 0.0
        for k in range(begin, end):
            squared += (alpha[law] * x[k] - xi[k]) ** 2
        scale = bound / np.sqrt(squared) if squared > bound * bound else 1.0
        total = 0.0
        for k in range(begin, end):
            total += (alpha[law] * x[k] - scale * (alpha[law] * x[k] - xi[k])) ** 2
        largest = max(largest, np.sqrt(total))
    return largest


@njit(cache=True, error_model="numpy")
def _sweep(count, g, q, sliding, laws, alpha, x, xi, change):  # type: ignore[no-untyped-def]
    """Do projected Gauss–Seidel sweeps over the three laws."""
    d = len(q)
    for _ in range(count):
        for law in range(3):
            begin, end = (0, 1) if law == 0 else _lanes_of(law, sliding, d)
            for k in range(begin, end):
                xi[k] = q[k]
                for j in range(d):
                    xi[k] += g[k, j] * x[j]
            size = 1.0 / alpha[law] if alpha[law] > 0.0 else 0.0
            if law == 0:
                x[0] = max(x[0] - size * xi[0], 0.0)
            else:
                project_into_ball(size, laws[2 * law - 1] + laws[2 * law - 2] * x[0], begin, xi, x[begin:end], change)


@njit(cache=True, error_model="numpy")
def _linearise(g, q, sliding, laws, alpha, x, xi, system):  # type: ignore[no-untyped-def]
    """Write the linear system of a Newton step, with its right-hand side as the last column, from ξ of ``_violation``.

    If x_i = Λ_i − ξ_i/α_i lies in the set of law i, its equation is ξ_i = 0. Otherwise it is Λ_N = 0 for the normal
    law; for a disc or ball of radius b, with t = x_i/‖x_i‖, κ = b/‖x_i‖ and P = κ(I − t tᵀ), it is

        P(Gδ)_i + α(I − P)δ_i − αμ t δ_N = α(b t − Λ_i).
    """
    d = len(q)
    system[:] = 0.0
    is_closed = alpha[0] * x[0] > xi[0] and alpha[0] > 0.0
    if is_closed:
        for j in range(d):
            system[0, j] = g[0, j]
        system[0, d] = -xi[0]
    else:
        system[0, 0], system[0, d] = 1.0, -x[0]
    for law in (1, 2):
        begin, end = _lanes_of(law, sliding, d)
        mu = laws[2 * law - 2]
        bound, squared = laws[2 * law - 1] + mu * max(x[0], 0.0), 0.0
        for k in range(begin, end):
            squared += (x[k] - xi[k] / alpha[law]) ** 2 if alpha[law] > 0.0 else 0.0
        length = np.sqrt(squared)
        for k in range(begin, end):
            if alpha[law] <= 0.0:  # an impulse of this law causes no velocity, so it does not change
                system[k, k] = 1.0
                continue
            if length <= bound and bound > 0.0:
                for j in range(d):
                    system[k, j] = g[k, j]
                system[k, d] = -xi[k]
                continue
            along, kappa = (x[k] - xi[k] / alpha[law]) / max(length, 1e-300), bound / max(length, 1e-300)
            system[k, d] = alpha[law] * (bound * along - x[k])
            if is_closed:
                system[k, 0] -= alpha[law] * mu * along
            for j in range(begin, end):
                identity = 1.0 if j == k else 0.0
                across = kappa * (identity - along * (x[j] - xi[j] / alpha[law]) / max(length, 1e-300))
                system[k, j] += alpha[law] * (identity - across)
                for m in range(d):
                    system[k, m] += across * g[j, m]


@njit(cache=True, error_model="numpy")
def _solve_linear_system(system):  # type: ignore[no-untyped-def]
    """Write the solution of a linear system, by Gaussian elimination, to its last column; return whether it was found.

    An unknown without a pivot is damped, so that it hardly changes.
    """
    d = len(system)
    largest = 0.0
    for k in range(d):
        for j in range(d):
            largest = max(largest, abs(system[k, j]))
    if not 0.0 < largest < np.inf:
        return False
    for k in range(d):
        pivot = k
        for row in range(k + 1, d):
            if abs(system[row, k]) > abs(system[pivot, k]):
                pivot = row
        if abs(system[pivot, k]) <= PIVOT * largest:
            system[k, k] += largest
            pivot = k
        for j in range(d + 1):
            system[k, j], system[pivot, j] = system[pivot, j], system[k, j]
        for row in range(k + 1, d):
            factor = system[row, k] / system[k, k]
            if factor != 0.0:
                for j in range(k, d + 1):
                    system[row, j] -= factor * system[k, j]
    for k in range(d - 1, -1, -1):
        for j in range(k + 1, d):
            system[k, d] -= system[k, j] * system[j, d]
        system[k, d] /= system[k, k]
        if not abs(system[k, d]) < np.inf:
            return False
    return True
