"""The work of a solve, counted instead of timed, so that decisions based on it are the same on every machine.

The unit is a nominal second, calibrated by the times of sweeps and Newton steps on one processor core of the year 2020.
Each sweep and each step has a constant part, which dominates on a few contacts. The triangular factors of a step with n
rows and f entries take about f²/n multiplications if their columns have equal lengths.
"""

from dataclasses import dataclass

SWEEP = 2e-6
"""Constant part of a sweep, including its share of a residual check [s]."""

SWEEP_ENTRY = 1e-9
"""Time per entry of G in a sweep [s]."""

STEP = 1e-3
"""Constant part of a Newton step [s]."""

DENSE_STEP = 1e-4
"""Constant part of a Newton step with a dense system [s]."""

FACTOR_ENTRY = 3e-8
"""Time per entry of the factors [s]."""

MULTIPLICATION = 3e-10
"""Time of one of the f²/n multiplications of a factorisation [s]."""


@dataclass
class Work:
    """The work of one solve.

    Attributes:
        entries: number of entries of G.
        seconds: nominal seconds so far.
    """

    entries: int
    seconds: float = 0.0

    def count_sweeps(self, count: int) -> None:
        """Add ``count`` sweeps."""
        self.seconds += count * (SWEEP + SWEEP_ENTRY * self.entries)

    def count_dense_step(self, rows: int) -> None:
        """Add a Newton step with a dense system of ``rows`` rows."""
        self.seconds += DENSE_STEP + MULTIPLICATION * rows**3 / 3.0

    def count_step(self, rows: int, fill: int) -> None:
        """Add a Newton step with a sparse system of ``rows`` rows, whose factors have ``fill`` entries."""
        self.seconds += STEP + FACTOR_ENTRY * fill + MULTIPLICATION * fill * (fill / max(rows, 1))
