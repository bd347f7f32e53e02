"""Extrapolation of Moreau's rule between switching points.

Between switching points the midpoint rule T_n(H), n steps of H/n, has an expansion in powers of the step, so that the
scheme of Aitken and Neville,

    T_{n,1} = T_n,      T_{n,k+1} = T_{n,k} + (T_{n,k} − T_{n−1,k}) / ((n/(n−k))^p − 1),

raises the order by p with each column (Deuflhard 1983; Hairer, Nørsett & Wanner 1993, II.9). For a reversible system
p = 2, otherwise p = 1. The difference of the last two columns estimates the error.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...arrays import FloatArray
from ...errors import ProblemError
from ..bodies.system import System
from .sequences import Attempt, is_reversible
from .step import LawStates, Step
from .variable_stepper import VariableStepper


@dataclass(frozen=True)
class Extrapolated(VariableStepper):
    """Moreau's rule, extrapolated between switching points.

    Attributes:
        tolerance: relative error of one step.
        min_step: Δt_min [s], the accuracy of switching points.
        max_step: Δt_max [s]; that of the scene if None.
        levels: largest number of sequences, at least 2; the order is 2·levels in reversible systems, else ``levels``.
        search: method that locates switching points, a name in ``SEARCHES``.
    """

    tolerance: float = 1e-7
    min_step: float = 1e-9
    max_step: float | None = None
    levels: int = 4
    search: str = "anticipating"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.levels < 2:
            raise ProblemError(f"levels must be at least 2, got {self.levels}.")

    @property
    def max_levels(self) -> int:
        """The option ``levels``."""
        return self.levels

    def compute_row(self, row: list[FloatArray], first: FloatArray, system: System) -> list[FloatArray]:
        """Compute row n of the extrapolation table from row n−1 and T_{n,1}."""
        power, n, extended = 2 if is_reversible(system) else 1, len(row) + 1, [first]
        for k in range(1, n):
            ratio = (n / (n - k)) ** power - 1.0
            extended.append(extended[k - 1] + (extended[k - 1] - row[k - 1]) / ratio)
        return extended

    def complete_attempt(self, sequence: Attempt, last: FloatArray, time: float) -> Attempt:
        """Return the attempt with the extrapolated (q, u); if a slip reverses, return an attempt without end."""
        assert sequence.end is not None
        position, velocity = np.split(last, [len(sequence.end.position)])
        if _reverses_slip(sequence.substeps[-1][0], sequence.states, velocity):
            return Attempt(None, [], sequence.states, [])
        return replace(sequence, end=replace(sequence.end, time=time, position=position, velocity=velocity))

    def error_order(self, levels: int, system: System) -> int:
        """Return the order of the error estimate of ``levels`` sequences, as a power of the step."""
        return 2 * levels - 1 if is_reversible(system) else levels


def _reverses_slip(step: Step, states: LawStates, velocity: FloatArray) -> bool:
    """Return whether a contact that slips in ``step`` would slip the other way with the extrapolated ``velocity``."""
    if step.contacts is None or not states.slips:
        return False
    velocities = step.contacts.lanes(step.contacts.transposed_times(velocity))
    rows = np.searchsorted(step.contacts.keys, list(states.slips))
    friction = np.array(list(states.slips.values()))
    friction_power = np.einsum("ij,ij->i", velocities[rows, 1 : 1 + friction.shape[1]], friction)
    return bool((friction_power > 0.0).any())
