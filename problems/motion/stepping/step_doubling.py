"""Step doubling, the stepper of Studer & Glocker (2005, section 6)."""

from dataclasses import dataclass
from typing import ClassVar

from ...arrays import FloatArray
from ..bodies.system import System
from .sequences import is_reversible
from .variable_stepper import VariableStepper


@dataclass(frozen=True)
class StepDoubling(VariableStepper):
    """Comparison of one step with two half steps: the difference estimates the error, the half steps give the result.

    Attributes:
        tolerance: relative error of one step.
        min_step: Δt_min [s], the accuracy of switching points.
        max_step: Δt_max [s]; that of the scene if None.
        search: method that locates switching points, a name in ``SEARCHES``.
    """

    tolerance: float = 1e-5
    min_step: float = 1e-7
    max_step: float | None = None
    search: str = "nested"

    max_levels: ClassVar[int] = 2

    def compute_row(self, row: list[FloatArray], first: FloatArray, system: System) -> list[FloatArray]:
        """Return T_{n−1} and T_n."""
        return [*row[-1:], first]

    def error_order(self, levels: int, system: System) -> int:
        """Return the order of the error estimate, as a power of the step."""
        return 3 if is_reversible(system) else 2
