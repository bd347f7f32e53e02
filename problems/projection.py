"""Projection of positions: what keeps penetrations of Moreau's rule from lasting.

The rule imposes contact laws on velocities. Bodies that meet within a step penetrate by up to |γ_N| Δt before their
contact is active, and where they then stay together, ξ_N = 0 keeps them that deep for ever. The projection moves the
end of a step to the nearest position, in the metric of M, in which no active contact is deeper than allowed:

    δq = M⁻¹ W_N p,      0 ≤ g_E + d + W_Nᵀ δq  ⊥  p ≥ 0,      g_E = g_M + W_Nᵀ u_E Δt/2.

Velocities stay as they are, so no kinetic energy is made (Acary, *Projected event-capturing time-stepping schemes for
nonsmooth mechanical systems*, CMAME 256, 2013). The depth d that stays keeps lasting contacts active.
"""

import numpy as np
from numba import njit

from .laws import FloatArray
from .pieces import Pieces

LARGEST_SWEEPS = 50
"""Most sweeps of one projection. What is left over is met again in the next step."""

ACCURACY = 0.1
"""A projection is over when no active contact is deeper than (1 + ``ACCURACY``) times the depth that is allowed."""


def projection(scaled: Pieces, gap: FloatArray, depth: float) -> FloatArray | None:
    """Return δ with δq = S δ, M⁻¹ = S Sᵀ, or None if nothing is too deep.

    Args:
        scaled: W̃ = Sᵀ W in pieces, a contact a block, N its first lane.
        gap: g_E of each contact [m], shape (n_contacts,).
        depth: d [m], positive.

    Returns:
        δ, shape (n_chunks · length,).
    """
    if not len(gap) or gap.min() >= -(1.0 + ACCURACY) * depth:
        return None
    moved = np.zeros((scaled.n_chunks + 1) * scaled.length)  # the last chunk is the idle one
    _project(scaled.starts, scaled.chunks, scaled.values, gap, depth, moved)
    return moved[: -scaled.length]


@njit(cache=True)
def _project(starts, chunks, values, gap, depth, moved):  # type: ignore[no-untyped-def]
    """Gauss–Seidel on the normal lanes; contacts without impulse that stay open cost one product each."""
    n_contacts, length = len(gap), values.shape[2]
    pushed, diagonal = np.zeros(n_contacts), np.zeros(n_contacts)
    for i in range(n_contacts):
        for p in range(starts[i], starts[i + 1]):
            for k in range(length):
                diagonal[i] += values[p, 0, k] ** 2
    for _ in range(LARGEST_SWEEPS):
        deepest = 0.0
        for i in range(n_contacts):
            space = gap[i] + depth
            for p in range(starts[i], starts[i + 1]):
                for k in range(length):
                    space += values[p, 0, k] * moved[length * chunks[p] + k]
            deepest = max(deepest, -space)
            if (space >= 0.0 and pushed[i] == 0.0) or diagonal[i] == 0.0:
                continue
            push = max(pushed[i] - space / diagonal[i], 0.0)
            change = push - pushed[i]
            pushed[i] = push
            for p in range(starts[i], starts[i + 1]):
                for k in range(length):
                    moved[length * chunks[p] + k] += values[p, 0, k] * change
        if deepest <= ACCURACY * depth:
            break
