"""Which sweeps are fast on a problem: a choice by its size and its couplings alone.

Momentum halves the sweeps of many contacts in space. Over the assembled matrix a sweep reads each pair of contacts of a
body, over the factors each contact of it: on a slab that rests on five hundred the first takes two hundred times as
long. Where both read as much, the matrix needs fewer operations, and its sweeps have the safeguard for high friction.
"""

import numpy as np

from ...problems.contact.problem import ContactProblem
from ..prox.safeguarded_sorprox import SafeguardedSORprox
from ..prox.sorprox import SORprox

FIRST = (1.1, 0.8)
"""Relaxation and momentum for many spatial contacts."""

MANY = 100
"""Spatial contacts from which on momentum pays."""

DENSE = 1.5
"""Sweeps go over the factors where the Delassus matrix has this many times their numbers."""


def sweeps_for(problem: ContactProblem) -> SORprox | SafeguardedSORprox:
    """Return the sweeps that are fast on problems like this one, by its size alone."""
    relaxation, momentum = FIRST if problem.layout.width == 3 and problem.n_contacts >= MANY else (1.5, 0.0)
    if _is_dense(problem):
        return SORprox(relaxation=relaxation, momentum=momentum, form="factors")
    return SORprox(relaxation=relaxation, momentum=momentum) if momentum else SafeguardedSORprox(relaxation)


def _is_dense(problem: ContactProblem) -> bool:
    """Whether a sweep over the assembled matrix would read more numbers than one over the factors."""
    if problem.factors is None:
        return False
    pieces = problem.factor_pieces()
    on_chunk = np.bincount(pieces.chunks, minlength=pieces.n_chunks)[: pieces.n_chunks]
    in_matrix = pieces.width**2 * float((on_chunk.astype(np.float64) ** 2).sum())
    return in_matrix > DENSE * 2.0 * pieces.values.size
