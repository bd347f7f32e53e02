"""Step doubling, the stepper of Studer & Glocker (2005, section 6)."""

from dataclasses import dataclass
from typing import ClassVar

from ...arrays import FloatArray
from ..bodies.system import System
from .sequences import is_reversible
from .variable_stepper import VariableStepper


@dataclass(frozen=True)
class StepDoubling(VariableStepper):
    """One step against two halves, whose difference estimates the error; the halves are kept as they are.

    Attributes:
        tolerance: relative error of one step.
        min_step: Δt_min [s], to which switching points are located.
        max_step: Δt_max [s]; the scene's if None.
        search: how switching points are located, a name in ``SEARCHES``.
    """

    tolerance: float = 1e-5
    min_step: float = 1e-7
    max_step: float | None = None
    search: str = "nested"

    max_levels: ClassVar[int] = 2

    def next_row(self, row: list[FloatArray], first: FloatArray, system: System) -> list[FloatArray]:
        """Return T_{n−1} and T_n."""
        return [*row[-1:], first]

    def error_order(self, levels: int, system: System) -> int:
        """Return the power of the step with which the error estimate falls."""
        return 3 if is_reversible(system) else 2
