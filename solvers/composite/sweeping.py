"""Which sweeps are fast on a problem: a choice by its size and its couplings alone.

A contact that nothing else acts on NSGS solves in one sweep. On many momentum halves the number of sweeps. Over the
assembled matrix a sweep reads each pair of contacts of a body, over the factors each contact of it: on a slab that
rests on five hundred the first takes two hundred times as long. Such a slab is all one contact to momentum, which only
delays it. Where both forms read as much, the matrix needs fewer operations, and its sweeps have the safeguard for high
friction.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ...problems.arrays import FloatArray, IntArray
from ...problems.contact.problem import ContactProblem
from ..iteration.stopping import LONGEST_INTERVAL
from ..prox.nesterov_sorprox import NesterovSORprox
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

UNCOUPLED = 0.0
"""The density where no two contacts share a body."""

DENSE, ONE_BODY = 1.5, 10.0
"""Sweeps go over the factors where the Delassus matrix has the first times their numbers, without momentum where it has
the second times."""

FEW_ROWS, DENSE_ON_FEW = 150, 6.0
"""Up to so many rows they do so only where it has this many times: below, the safeguard saves more than the numbers."""

ROWS_OF_A_LOOK = 100
"""Rows that are swept in the time of one look at the residual, which on few rows is that of its calls."""

ALONE, SAFEGUARDED = NSGS(), SafeguardedSORprox(RELAXATION)
"""The sweeps of small problems, made once: making them takes as long as some of their sweeps."""


def sweeps_for(problem: ContactProblem) -> Sweeps:
    """Return the sweeps that are fast on problems like this one, by its size and couplings."""
    numbers = density(problem)
    if numbers == UNCOUPLED:
        return ALONE
    is_many = problem.layout.sliding == 2 and problem.n_contacts >= MANY and numbers <= ONE_BODY
    relaxation, momentum = FIRST if is_many else (RELAXATION, 0.0)
    if numbers > (DENSE_ON_FEW if problem.n_rows <= FEW_ROWS else DENSE):
        return SORprox(relaxation=relaxation, momentum=momentum, form="factors")
    return SORprox(relaxation=relaxation, momentum=momentum) if is_many else SAFEGUARDED


def may_mix(problem: ContactProblem) -> bool:
    """Whether contacts act on each other, and G is not many times as large as its factors."""
    return UNCOUPLED < density(problem) <= ONE_BODY


def last_digits_for(problem: ContactProblem) -> Sweeps | NesterovSORprox:
    """Return the sweeps that go on from where other methods have come near the answer."""
    return NesterovSORprox() if may_mix(problem) else sweeps_for(problem)


def sweeps_between_looks(problem: ContactProblem, sweeps: Sweeps) -> int:
    """Return how many sweeps take about as long as a look at the residual does, 1 to ``LONGEST_INTERVAL``.

    It is 1 where the first sweep may be exact.
    """
    return 1 if sweeps is ALONE else max(1, min(LONGEST_INTERVAL, ROWS_OF_A_LOOK // problem.n_rows))


def density(problem: ContactProblem) -> float:
    """Return the numbers that a sweep reads over the assembled matrix, relative to one over the factors.

    It is ``UNCOUPLED`` where each contact has bodies, or a block of the matrix, of its own.
    """
    if problem.n_contacts <= 1:
        return UNCOUPLED
    if problem.matrix is not None:
        matrix = problem.matrix
        return 1.0 if _couples(matrix.indptr, matrix.indices, matrix.data, problem.layout.contact_of_row) else UNCOUPLED
    pieces = problem.factor_pieces()
    counts = np.bincount(pieces.chunks, minlength=pieces.n_chunks + 1)[:-1]
    if counts.max(initial=0) <= 1:
        return UNCOUPLED
    return pieces.width**2 * float(counts @ counts) / max(2.0 * pieces.values.size, 1.0)


@njit(cache=True)
def _couples(starts: NDArray[Any], columns: NDArray[Any], values: FloatArray, contact_of_row: IntArray) -> bool:
    """Whether a matrix, shape (n_rows, n_rows), has an entry between two contacts."""
    for row in range(len(contact_of_row)):
        for place in range(starts[row], starts[row + 1]):
            if contact_of_row[columns[place]] != contact_of_row[row] and values[place] != 0.0:
                return True
    return False
