"""Nominal times of sweeps, interior-point steps and cone programs, computed from numbers of operations.

There are m blocks (contacts and joints). They have k rows in total, including the padding to blocks of equal width. A
factorisation has f operations.

    sweep                  10 ns · k for contacts alone,   50 ns · k with joints or rolling friction
    interior-point step    0.3 ms + 5 µs · m + f / 15 GHz
    cone program           20 f / 3 GHz

A cone program takes about 20 steps, each with a factorisation by entries instead of blocks. Decisions that compare such
numbers are the same on all machines and under any load.
"""

from ...problems.contact.problem import ContactProblem

MAX_STEPS = 20
"""Largest time of a window of sweeps or of a cone program, in interior-point steps."""

SWEEP_SECONDS_PER_ROW, GENERAL_SWEEP_SECONDS_PER_ROW = 1e-8, 5e-8
"""Seconds per row of a sweep over contacts alone, and of a sweep over a problem with joints or rolling friction."""

STEP_SECONDS, STEP_SECONDS_PER_BLOCK, STEP_SECONDS_PER_OPERATION = 3e-4, 5e-6, 1 / 15e9
"""Seconds of an interior-point step: the constant part, per block, and per operation of its factorisation."""

PROGRAM_SECONDS_PER_OPERATION = 20 / 3e9
"""Seconds of a cone program for each operation of a factorisation."""


def sweep_seconds(problem: ContactProblem) -> float:
    """Return the nominal seconds of a sweep."""
    layout = problem.layout
    seconds_per_row = SWEEP_SECONDS_PER_ROW if layout.has_contacts_only else GENERAL_SWEEP_SECONDS_PER_ROW
    return seconds_per_row * layout.n_blocks * layout.width


def step_seconds(problem: ContactProblem, operations: float) -> float:
    """Return the nominal seconds of an interior-point step whose factorisation takes ``operations``."""
    return STEP_SECONDS + STEP_SECONDS_PER_BLOCK * problem.layout.n_blocks + STEP_SECONDS_PER_OPERATION * operations


def program_seconds(operations: float) -> float:
    """Return the nominal seconds of a cone program if a factorisation takes ``operations``."""
    return PROGRAM_SECONDS_PER_OPERATION * operations
