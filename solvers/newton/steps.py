"""Newton steps on the projection equations, until they no longer help.

Each step solves J δ = right (``linearised``), in impulses scaled by √α, so that neither the units nor the mass ratios
of contacts decide over pivots:

    (D J D + damping · I) y = D right,      δ = D y,      D = diag(1/√α).

Where contacts over-determine the bodies J has no full rank. The damping makes the step the proximal one, which leaves
the solution where it is: it weighs δ, not Λ, and δ vanishes there. Little damping gives Newton's quadratic convergence;
more keeps undetermined impulses from running away.
"""

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from ...problems.laws import FloatArray
from ..interface import Stop
from ..prox.iteration import Advance
from .linearised import Equations, Linearised

DAMPINGS = (1e-12, 1e-3)
"""What successive attempts weigh the step with, relative to α; the first is hardly more than rounding."""

MOST_STEPS = (8, 10)
"""Steps of one attempt with each damping: they may raise the residual at first, while states change."""

HOPELESS = 1e2
"""An attempt ends when the residual exceeds this many times the one it began with."""

PIVOT_THRESHOLD = 0.1
"""A diagonal pivot is taken unless it is below this fraction of its column: that keeps the factors sparse."""


def newton_steps(
    equations: Equations,
    measure: Callable[[FloatArray], float],
    impulses: FloatArray,
    first: float,
    damping: float,
    stop: Stop,
    advance: Advance,
) -> tuple[FloatArray, float]:
    """Do Newton steps from Λ, whose residual is ``first``; return the best Λ of all and its residual.

    ``measure`` is the judge's residual by the judge's arithmetic: rounding must not pass for progress.
    """
    best, lowest, present = impulses, first, first
    for _ in range(MOST_STEPS[DAMPINGS.index(damping)]):
        if advance.iteration >= stop.max_iterations or advance.monitor.is_late:
            break
        step = newton_step(equations, impulses, damping)
        if step is None:
            break
        impulses = step
        advance.arrive(impulses)
        before, present = present, measure(impulses)
        if present < lowest:
            best, lowest = impulses, present
        converged = lowest <= stop.tolerance or (present == lowest and present > 0.5 * before)
        if converged or not present <= HOPELESS * first:
            break
    return best, lowest


def newton_step(equations: Equations, impulses: FloatArray, damping: float) -> FloatArray | None:
    """Return Λ after one step, shape (n_rows,), or None where the system cannot be solved."""
    system = equations.linearised(impulses)
    if len(system.active) == 0:
        return system.base
    step = _solved(system, 1.0 / np.sqrt(equations.row_alpha[system.active]), damping)
    if step is None or not np.isfinite(step).all():
        return None
    moved = system.base
    moved[system.active] += step
    return moved


def _solved(system: Linearised, scale: FloatArray, damping: float) -> FloatArray | None:
    """Return δ over the active rows."""
    scaling = sp.diags_array(scale)
    matrix = scaling @ system.matrix @ scaling + damping * sp.eye_array(len(scale))
    try:
        factors = splu(
            sp.csc_matrix(matrix),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=PIVOT_THRESHOLD,
            options={"SymmetricMode": True},
        )
    except RuntimeError:  # exactly singular
        return None
    return np.asarray(scale * factors.solve(scale * system.right))
