"""Corrections: an iteration offers its iterates to another method and continues from the result."""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import Prepared, Solver
from .stopping import Clock


class Correction(Protocol):
    """Corrects the iterates of one solve."""

    def begin_phase(self) -> None:
        """Note that the iteration starts, or restarts in another way."""
        ...

    def correct(self, impulses: FloatArray, residual: float, is_last: bool) -> tuple[FloatArray, float]:
        """Return better impulses [N s], shape (n_rows,), and their residual, or the given ones.

        ``is_last`` means that the phase ends with this iterate unless it is corrected.
        """
        ...


BeginCorrection = Callable[[Clock, float], Correction]
"""``begin(clock, tolerance)`` returns the correction of one solve, given its clock and its tolerance."""


class NoCorrection:
    """The correction that leaves every iterate unchanged."""

    def __init__(self, clock: Clock, tolerance: float) -> None:
        """Take the arguments of every ``BeginCorrection``."""

    def begin_phase(self) -> None:
        """See ``Correction``."""

    def correct(self, impulses: FloatArray, residual: float, is_last: bool) -> tuple[FloatArray, float]:
        """See ``Correction``."""
        return impulses, residual


@runtime_checkable
class Correctable(Solver, Protocol):
    """A solver that offers its iterates to a correction."""

    def prepare_corrected(self, problem: ContactProblem, begin: BeginCorrection) -> Prepared:
        """Prepare as ``prepare`` does; ``begin`` makes the correction of each solve."""
        ...
