"""Selection of the fastest sweeps for a problem, based only on its size and on the coupling of its contacts.

NSGS solves uncoupled contacts in one sweep. With many contacts, momentum halves the number of sweeps. A sweep over the
assembled matrix reads a block for each pair of contacts on a body; a sweep over the factors reads one for each contact.
On a slab that rests on five hundred contacts, a sweep over the matrix therefore takes two hundred times as long.
Momentum slows the convergence of such a slab, which behaves like a single contact. If both forms read the same amount
of data, the matrix needs fewer operations, and ``SafeguardedSORprox`` can be used.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ...problems.arrays import FloatArray, IntArray
from ...problems.compilation.interpretation import interpretable
from ...problems.contact.problem import ContactProblem
from ..iteration.momentum import MEASURED, Momentum
from ..iteration.stopping import MAX_CHECK_INTERVAL
from ..prox.accelerated_sorprox import NesterovSORprox
from ..prox.nsgs import NSGS
from ..prox.safeguarded_sorprox import SafeguardedSORprox
from ..prox.sorprox import SORprox

Sweeps = NSGS | SORprox | SafeguardedSORprox
"""Methods among which the sweeps of a composite solver are chosen."""

MIN_MOMENTUM_CONTACTS = 100
"""Minimum number of spatial contacts with which momentum saves time."""

RELAXATION = 1.5
"""Relaxation without momentum."""

FAST_RELAXATION, FAST_MOMENTUM = 1.1, MEASURED
"""Relaxation and momentum for many spatial contacts; the momentum follows the measured rate of convergence."""

UNCOUPLED_READ_RATIO = 0.0
"""Read ratio of a problem in which no two contacts share a body."""

FACTORS_READ_RATIO, MAX_MOMENTUM_READ_RATIO = 1.5, 10.0
"""Ratios (see ``compute_read_ratio``) above which sweeps use the factors, and above which they have no momentum."""

MAX_SMALL_ROWS, FACTORS_READ_RATIO_ON_FEW_ROWS = 150, 6.0
"""Largest number of rows of a problem that counts as small; for small problems, the second value replaces
``FACTORS_READ_RATIO``."""

ROWS_PER_CHECK = 100
"""Number of rows that sweeps visit in the time of one residual check, which is mainly call overhead on few rows."""

UNCOUPLED_SWEEPS, SAFEGUARDED_SWEEPS = NSGS(), SafeguardedSORprox(RELAXATION)
"""The sweeps of small problems, created once because creating them takes as long as several sweeps."""


def select_sweeps(problem: ContactProblem) -> Sweeps:
    """Return the sweeps that are expected to be fastest on ``problem``."""
    read_ratio = compute_read_ratio(problem)
    if read_ratio == UNCOUPLED_READ_RATIO:
        return UNCOUPLED_SWEEPS
    is_spatial = problem.layout.sliding == 2
    uses_momentum = is_spatial and problem.n_contacts >= MIN_MOMENTUM_CONTACTS and read_ratio <= MAX_MOMENTUM_READ_RATIO
    relaxation = FAST_RELAXATION if uses_momentum else RELAXATION
    momentum: Momentum = FAST_MOMENTUM if uses_momentum else 0.0
    if read_ratio > (FACTORS_READ_RATIO_ON_FEW_ROWS if problem.n_rows <= MAX_SMALL_ROWS else FACTORS_READ_RATIO):
        return SORprox(relaxation=relaxation, momentum=momentum, form="factors")
    return SORprox(relaxation=relaxation, momentum=momentum) if uses_momentum else SAFEGUARDED_SWEEPS


def can_accelerate(problem: ContactProblem) -> bool:
    """Whether contacts are coupled, and the read ratio is at most ``MAX_MOMENTUM_READ_RATIO``."""
    return UNCOUPLED_READ_RATIO < compute_read_ratio(problem) <= MAX_MOMENTUM_READ_RATIO


def refining_sweeps(problem: ContactProblem) -> Sweeps | NesterovSORprox:
    """Return the sweeps that refine an approximate solution of another method."""
    return NesterovSORprox() if can_accelerate(problem) else select_sweeps(problem)


def sweeps_between_checks(problem: ContactProblem, sweeps: Sweeps) -> int:
    """Return the number of sweeps that take about as long as a residual check, from 1 to ``MAX_CHECK_INTERVAL``.

    The number is 1 if the first sweep may be exact.
    """
    return 1 if sweeps is UNCOUPLED_SWEEPS else max(1, min(MAX_CHECK_INTERVAL, ROWS_PER_CHECK // problem.n_rows))


def compute_read_ratio(problem: ContactProblem) -> float:
    """Return how many numbers a sweep reads from the assembled matrix, relative to those it reads from the factors.

    The ratio is ``UNCOUPLED_READ_RATIO`` if no two contacts share a body or are coupled by an entry of the matrix. It
    is 1 if the problem holds only a matrix that couples contacts.
    """
    if problem.n_contacts <= 1:
        return UNCOUPLED_READ_RATIO
    if problem.matrix is not None:
        matrix = problem.matrix
        return (
            1.0
            if couples_contacts(matrix.indptr, matrix.indices, matrix.data, problem.layout.contact_of_row)
            else UNCOUPLED_READ_RATIO
        )
    pieces = problem.factor_pieces()
    max_shared, pairs = count_shared_chunks(pieces.chunks, pieces.n_chunks)
    return (
        UNCOUPLED_READ_RATIO
        if max_shared <= 1
        else pieces.width * pairs / max(2.0 * len(pieces.chunks) * pieces.length, 1.0)
    )


@interpretable
@njit(cache=True, error_model="numpy")
def couples_contacts(starts: NDArray[Any], columns: NDArray[Any], values: FloatArray, contact_of_row: IntArray) -> bool:
    """Whether a matrix, shape (n_rows, n_rows), has an entry between two contacts."""
    for row in range(len(contact_of_row)):
        for entry in range(starts[row], starts[row + 1]):
            if contact_of_row[columns[entry]] != contact_of_row[row] and values[entry] != 0.0:
                return True
    return False


@interpretable
@njit(cache=True, error_model="numpy")
def count_shared_chunks(chunks: IntArray, n_chunks: int) -> tuple[int, float]:
    """Return the largest number of contacts on one body (chunk), and the number of ordered pairs on a common body."""
    counts = np.zeros(n_chunks + 1)
    for chunk in chunks:
        counts[chunk] += 1.0
    max_count, pairs = 0.0, 0.0
    for count in counts[:n_chunks]:
        max_count = max(max_count, count)
        pairs += count * count
    return int(max_count), pairs
