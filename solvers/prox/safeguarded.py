"""SafeguardedSORprox: SORprox whose contacts give up over-relaxation one by one where they oscillate."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.judge import Residual
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.names import described
from ..iteration.loop import PreparedIteration
from ..iteration.safeguard import OscillationGuard
from ..sweeps.delassus import DelassusSweep
from ..sweeps.step_size import check_relaxation, diagonal_step_sizes


@dataclass(frozen=True)
class SafeguardedSORprox:
    """SORprox over the Delassus matrix, with the step size of each contact cut where its impulses oscillate.

    Attributes:
        relaxation: ω that every contact begins with.

    Raises:
        SolverError: for an option out of range.
    """

    relaxation: float = 1.5

    model: ClassVar[Model] = Model.COULOMB
    has_iterates: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_relaxation(self.relaxation)

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return described(self)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return None

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G and the first step sizes."""
        sizes = diagonal_step_sizes(problem, self.relaxation)
        sweep = DelassusSweep.over(problem, problem.delassus_blocks(), sizes)
        return PreparedIteration(problem, Residual(problem), lambda start: SafeguardedIterates(sweep, start))


class SafeguardedIterates:
    """Λ of a Gauss–Seidel iteration with step sizes of its own; see ``iteration.Iterates``."""

    def __init__(self, sweep: DelassusSweep, start: FloatArray) -> None:
        first, *others = sweep.laws
        self._first, self._sizes = first, first.copy()
        self._layout = sweep.layout
        self._padded = sweep.layout.pad(start).reshape(-1)
        self._guard = OscillationGuard(first.reshape(-1, 2), self._padded)
        self._iterates = replace(sweep, laws=(self._sizes, *others)).over_padded(self._padded)

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps, with smaller steps where contacts oscillate."""
        self._guard.sweep(count, self._iterates.sweep, self._take_smaller_steps)

    def _take_smaller_steps(self) -> None:
        np.multiply(self._first, np.repeat(self._guard.fraction, 2), out=self._sizes)

    def move_to(self, impulses: FloatArray) -> None:
        """Go on from ``impulses``, shape (n_rows,), with the step sizes as they have become."""
        self._padded[:] = self._layout.pad(impulses).reshape(-1)
        self._guard.restart()

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        return self._iterates.impulses()

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        return self._iterates.relative_velocity()
