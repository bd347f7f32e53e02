"""Which sweeps are fast on a problem: a choice by its size and its couplings alone.

A single contact NSGS solves in one sweep. On many momentum halves the number of sweeps. Over the assembled matrix a
sweep reads each pair of contacts of a body, over the factors each contact of it: on a slab that rests on five hundred
the first takes two hundred times as long. Such a slab is all one contact to momentum, which only delays it. Where both
forms read as much, the matrix needs fewer operations, and its sweeps have the safeguard for high friction.
"""

import numpy as np

from ...problems.contact.problem import ContactProblem
from ..prox.nsgs import NSGS
from ..prox.safeguarded_sorprox import SafeguardedSORprox
from ..prox.sorprox import SORprox

Sweeps = NSGS | SORprox | SafeguardedSORprox

MANY = 100
"""Spatial contacts from which on momentum pays."""

RELAXATION = 1.5
"""Without momentum."""

FIRST = (1.1, 0.8)
"""Relaxation and momentum for many spatial contacts."""

DENSE, ONE_BODY = 1.5, 10.0
"""Sweeps go over the factors where the Delassus matrix has the first times their numbers, without momentum where it has
the second times."""


def sweeps_for(problem: ContactProblem) -> Sweeps:
    """Return the sweeps that are fast on problems like this one, by its size and couplings."""
    if problem.n_contacts <= 1:
        return NSGS()
    density = _density(problem)
    is_many = problem.layout.sliding == 2 and problem.n_contacts >= MANY and density <= ONE_BODY
    relaxation, momentum = FIRST if is_many else (RELAXATION, 0.0)
    if density > DENSE:
        return SORprox(relaxation=relaxation, momentum=momentum, form="factors")
    return SORprox(relaxation=relaxation, momentum=momentum) if is_many else SafeguardedSORprox(relaxation)


def _density(problem: ContactProblem) -> float:
    """Return the numbers that a sweep reads over the assembled matrix, relative to one over the factors."""
    if problem.factors is None:
        return 1.0
    pieces = problem.factor_pieces()
    on_chunk = np.bincount(pieces.chunks, minlength=pieces.n_chunks)[: pieces.n_chunks].astype(np.float64)
    return float(pieces.width**2 * (on_chunk @ on_chunk) / max(2.0 * pieces.values.size, 1.0))
