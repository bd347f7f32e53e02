"""The work of a solve, counted instead of timed, so that what is decided by it is the same on every machine.

Work is counted in nominal seconds: about what sweeps and Newton steps take on one core of 2020. Per sweep and per step
there is a constant, which is all that matters for a handful of contacts. The triangular factors of a step with n rows
and f entries take about f²/n multiplications if their columns are equally long.
"""

from dataclasses import dataclass

SWEEP = 2e-6
"""Of a sweep over nothing, with its share of a look at the residual [s]."""

SWEEP_ENTRY = 1e-9
"""Of each entry of G in a sweep [s]."""

STEP = 1e-3
"""Of a Newton step over nothing [s]."""

DENSE_STEP = 1e-4
"""Of a Newton step over nothing whose system is dense [s]."""

FACTOR_ENTRY = 3e-8
"""Of each entry of the factors [s]."""

MULTIPLICATION = 3e-10
"""Of each of the f²/n multiplications of a factorisation [s]."""


@dataclass
class Work:
    """What one solve has done.

    Attributes:
        entries: entries of G.
        seconds: nominal seconds so far.
    """

    entries: int
    seconds: float = 0.0

    def count_sweeps(self, count: int) -> None:
        """Add ``count`` sweeps."""
        self.seconds += count * (SWEEP + SWEEP_ENTRY * self.entries)

    def count_dense_step(self, rows: int) -> None:
        """Add a Newton step over ``rows`` whose system is dense."""
        self.seconds += DENSE_STEP + MULTIPLICATION * rows**3 / 3.0

    def count_step(self, rows: int, fill: int) -> None:
        """Add a Newton step over ``rows`` whose factors have ``fill`` entries."""
        self.seconds += STEP + FACTOR_ENTRY * fill + MULTIPLICATION * fill * (fill / max(rows, 1))
