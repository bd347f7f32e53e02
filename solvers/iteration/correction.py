"""Corrections: an iteration may offer its iterates to another method, and go on from what that makes of them."""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import Prepared, Solver
from .clock import Clock


class Correction(Protocol):
    """What corrects the iterates of one solve."""

    def begin_phase(self) -> None:
        """Note that the iteration begins, or begins anew in another way."""
        ...

    def corrected(self, impulses: FloatArray, residual: float, is_last: bool) -> tuple[FloatArray, float]:
        """Return better impulses [N s], shape (n_rows,), and their residual, or those given.

        ``is_last`` says that the phase ends with this iterate if it is not corrected.
        """
        ...


BeginCorrection = Callable[[Clock, float], Correction]
"""``begin(clock, tolerance)`` returns the correction of a solve with so much time left, to that residual."""


class NoCorrection:
    """The correction that leaves every iterate as it is."""

    def __init__(self, clock: Clock, tolerance: float) -> None:
        """Take the arguments of every ``BeginCorrection``."""

    def begin_phase(self) -> None:
        """See ``Correction``."""

    def corrected(self, impulses: FloatArray, residual: float, is_last: bool) -> tuple[FloatArray, float]:
        """See ``Correction``."""
        return impulses, residual


@runtime_checkable
class Correctable(Solver, Protocol):
    """A solver that offers its iterates to a correction."""

    def prepare_corrected(self, problem: ContactProblem, begin: BeginCorrection) -> Prepared:
        """Do what ``prepare`` does; the iterates of each solve are corrected by what ``begin`` returns for it."""
        ...
