"""Newton steps on the projection equations, until they no longer help.

Each step solves J δ = right (``linearised``), in impulses scaled by √α, so that neither the units nor the mass ratios
of contacts decide over pivots:

    (D J D + damping · I) y = D right,      δ = D y,      D = diag(1/√α).

Where contacts over-determine the bodies J has no full rank. The damping makes the step the proximal one, which leaves
the solution where it is: it weighs δ, not Λ, and δ vanishes there (Levenberg 1944; Marquardt 1963; for equations whose
solutions are not isolated: Yamashita & Fukushima 2001). Little damping gives Newton's quadratic convergence; more keeps
undetermined impulses from running away.

Far from a solution a full step may lead to other states that lead back, a cycle. A search along the step, for the first
of t = 1, ½, …, 1/64 with

    ρ(Λ + tδ) < (1 − 10⁻⁴ t) ρ(Λ),      ρ the judge's residual,

breaks it (De Luca, Facchinei & Kanzow 1996). ρ has kinks, where no t may do; the shortest step is taken there, and the
best Λ of all is what counts. Neither way is better everywhere: attempts take them in turn.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from ...problems.laws import FloatArray
from .linearised import Equations, Linearised

HOPELESS = 1e2
"""An attempt ends when the residual exceeds this many times the one it began with."""

PIVOT_THRESHOLD = 0.1
"""A diagonal pivot is taken unless it is below this fraction of its column: that keeps the factors sparse."""

SUFFICIENT = 1e-4
"""Share of the linear decrease that a shortened step has to reach."""

SHORTEST = 1.0 / 64.0
"""The shortest part of a step that a search tries, and takes if none is better."""


@dataclass(frozen=True)
class Attempt:
    """How far and how carefully Newton's method is followed.

    Attributes:
        damping: what δ is weighed with, relative to α.
        most_steps: number of steps.
        is_searching: whether steps are shortened until the residual falls.
        gain: the attempt ends when a new best residual is more than this share of the residual before.
        patience: and when so many steps bring no new best residual.
    """

    damping: float
    most_steps: int
    is_searching: bool = False
    gain: float = 0.5
    patience: int = 100


SHARP = Attempt(damping=1e-12, most_steps=8)
"""Full steps with hardly more damping than rounding: they may raise the residual at first, while states change."""

DAMPED = Attempt(damping=1e-3, most_steps=10)
"""Full steps where undetermined impulses run away."""

THOROUGH = tuple(
    Attempt(damping, most_steps=30, is_searching=is_searching, gain=1.0, patience=10)
    for damping in (1e-12, 1e-6, 1e-3)
    for is_searching in (False, True)
)
"""What is tried where nothing else helps."""

SEARCHING = THOROUGH[1]
"""The one of them that helps most often."""


def newton_steps(
    equations: Equations,
    measure: Callable[[FloatArray], float],
    impulses: FloatArray,
    first: float,
    attempt: Attempt,
    tolerance: float,
    goes_on: Callable[[FloatArray], bool],
) -> tuple[FloatArray, float]:
    """Do Newton steps from Λ, whose residual is ``first``; return the best Λ of all and its residual.

    Args:
        equations: the projection equations.
        measure: the judge's residual by the judge's arithmetic: rounding must not pass for progress.
        impulses: Λ [N s], shape (n_rows,).
        first: its residual.
        attempt: how.
        tolerance: the residual to stop at.
        goes_on: is shown each iterate, and says whether there may be another.
    """
    best, lowest, present, waited = impulses, first, first, 0
    for _ in range(attempt.most_steps):
        step = newton_step(equations, impulses, attempt.damping)
        if step is None:
            break
        before, present = present, measure(step)
        if attempt.is_searching:
            impulses, present = _shortened(measure, impulses, before, step, present)
        else:
            impulses = step
        is_over = not goes_on(impulses)
        waited += 1
        is_new = present < lowest
        if is_new:
            best, lowest, waited = impulses, present, 0
        converged = lowest <= tolerance or (is_new and present > attempt.gain * before)
        if is_over or converged or waited >= attempt.patience or not present <= HOPELESS * first:
            break
    return best, lowest


def _shortened(
    measure: Callable[[FloatArray], float], origin: FloatArray, before: float, goal: FloatArray, present: float
) -> tuple[FloatArray, float]:
    """Return the first point from ``goal`` back to ``origin`` where the residual falls, or the last one tried."""
    part, point = 1.0, goal
    while not present < (1.0 - SUFFICIENT * part) * before and part > SHORTEST:
        part *= 0.5
        point = origin + part * (goal - origin)
        present = measure(point)
    return point, present


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
