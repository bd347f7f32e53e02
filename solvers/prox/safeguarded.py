"""SafeguardedSORprox: SORprox whose contacts give up over-relaxation one by one where they oscillate.

One slipping contact converges under SORprox only if |1 − ω(1 + μ|G_NT|/G_NN)| < 1, and no one can tell beforehand which
contacts of a problem will slip. So all begin with the ω asked for. Every few sweeps the last two increments of each
contact, d = Λ^ν − Λ^(ν−1), are compared: where they point against each other without shrinking, in the norm of
√α Λ (the contact's own scale of energy),

    dᵀd' < −OPPOSED ‖d‖ ‖d'‖      and      ‖d‖ > SHRINKS ‖d'‖,

its step size r is cut for good. Contacts that converge keep their step, and a problem without oscillation is swept as
by SORprox, but for the comparison.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numba import njit, uint64

from ...problems.contact import ContactProblem
from ...problems.judge import Residual
from ...problems.laws import FloatArray
from ...problems.model import Model
from ..interface import described
from .delassus_sweep import DelassusSweep
from .iteration import PreparedIteration
from .step_size import check_relaxation, diagonal_step_sizes

SWEEPS_BETWEEN_LOOKS = 20
"""Sweeps from one comparison to the next: long enough for a cut to show its effect."""

OPPOSED = 0.5
"""Increments are opposed when the cosine between them is below minus this."""

SHRINKS = 0.9
"""Increments that shrink faster than this a sweep are left alone."""

CUT = 0.6
"""What remains of a step size that is cut."""

SMALLEST = 1e-3
"""No step size falls below this fraction of the one it began with."""

ROUNDING = 1e-14
"""Increments below this fraction of the impulse are rounding, whatever their direction."""


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
        self._width = sweep.layout.width
        sweep = replace(sweep, laws=(self._sizes, *others))
        self._padded = sweep.layout.pad(start).reshape(-1)
        self._iterates = sweep.over_padded(self._padded)
        self._before, self._previous = np.empty_like(self._padded), np.empty_like(self._padded)
        self._since_look = 0

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps, and compare increments after every ``SWEEPS_BETWEEN_LOOKS``."""
        while count > 0:
            left = SWEEPS_BETWEEN_LOOKS - self._since_look
            if left == 2:
                self._before[:] = self._padded
            elif left == 1:
                self._previous[:] = self._padded
            step = min(count, left - 2 if left > 2 else 1)
            self._iterates.sweep(step)
            self._since_look += step
            count -= step
            if self._since_look == SWEEPS_BETWEEN_LOOKS:
                self._since_look = 0
                _cut_where_opposed(self._width, self._before, self._previous, self._padded, self._first, self._sizes)

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        return self._iterates.impulses()

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        return self._iterates.relative_velocity()


@njit(cache=True)
def _cut_where_opposed(width, before, previous, newest, first, sizes):  # type: ignore[no-untyped-def]
    """Cut the step sizes of every contact whose last two increments are opposed and do not shrink."""
    one, two, lanes = uint64(1), uint64(2), uint64(width)
    for i in range(uint64(len(sizes)) // two):
        k = lanes * i
        product, older, newer, impulse = 0.0, 0.0, 0.0, 0.0
        for lane in range(lanes):
            r = first[two * i + min(lane, one)]
            weight = 1.0 / r if r > 0.0 else 0.0
            a = previous[k + lane] - before[k + lane]
            b = newest[k + lane] - previous[k + lane]
            product += weight * a * b
            older += weight * a * a
            newer += weight * b * b
            impulse += weight * newest[k + lane] ** 2
        opposed = product < -OPPOSED * np.sqrt(older * newer)
        if opposed and newer > SHRINKS**2 * older and newer > ROUNDING**2 * impulse:
            for which in range(two):
                at = two * i + which
                sizes[at] = max(CUT * sizes[at], SMALLEST * first[at])
