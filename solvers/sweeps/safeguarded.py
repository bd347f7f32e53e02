"""A safeguard for sweeps: contacts that oscillate give up part of their step, one by one.

One slipping contact converges under SORprox only if |1 − ω(1 + μ|G_NT|/G_NN)| < 1, contacts of high friction can cycle
even where each is solved exactly, and which contacts of a problem will slip is not known beforehand. So all begin
with the step of the method. Every few sweeps the last two increments of each contact, d = Λ^ν − Λ^(ν−1), are compared:
where they point against each other without shrinking, in the norm of √α Λ (the contact's own scale of energy),

    dᵀd' < −OPPOSED ‖d‖ ‖d'‖      and      ‖d‖ > SHRINKS ‖d'‖,

the contact's step is cut for good. Contacts that converge keep theirs, and a problem without oscillation is swept as
without the safeguard, but for the comparison.
"""

import numpy as np
from numba import njit, uint64

from ...problems.arrays import FloatArray
from ..iteration.relaxation import ScalableIterates

INTERVALS = (19, 37, 73)
"""Sweeps from one comparison to the next, the first ones after a cut: long enough for it to show its effect. Prime, so
that looks meet a cycle of several iterates in different phases."""

OPPOSED = 0.5
"""Increments are opposed when the cosine between them is below minus this."""

SHRINKS = 0.9
"""Increments that shrink faster than this a sweep are left alone."""

CUT = 0.6
"""What remains of a step that is cut."""

SMALLEST = 1e-3
"""No step falls below this fraction of the one it began with."""

ROUNDING = 1e-14
"""Increments below this fraction of the impulse are rounding, whatever their direction."""


class SafeguardedIterates:
    """Iterates whose steps are cut where contacts oscillate.

    Attributes:
        padded: Λ padded and flat, which sweeps change in place.
    """

    def __init__(self, iterates: ScalableIterates) -> None:
        self._iterates, self.padded = iterates, iterates.padded
        self._fraction = np.empty(iterates.layout.n_blocks)  # what is left of each contact's step
        self._fraction.fill(1.0)
        self._before, self._previous = np.empty((2, len(iterates.padded)))
        self._since_look, self._looks_since_cut = 0, 0

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps; compare increments now and then, and go on with smaller steps after a cut."""
        newest = self.padded
        while count > 0:
            left = self._interval - self._since_look
            if left == 2:
                self._before[:] = newest
            elif left == 1:
                self._previous[:] = newest
            step = min(count, left - 2 if left > 2 else 1)
            self._iterates.sweep(step)
            self._since_look += step
            count -= step
            if step == left:
                self._since_look, self._looks_since_cut = 0, self._looks_since_cut + 1
                layout, sizes = self._iterates.layout, self._iterates.step_sizes
                lanes, sizes = (layout.width, layout.sliding, sizes.shape[1]), sizes.reshape(-1)
                if _cut_where_opposed(*lanes, self._before, self._previous, newest, sizes, self._fraction):
                    self._looks_since_cut = 0
                    self._iterates.scale_steps(self._fraction)

    def note_jump(self) -> None:
        """Compare no increments across what has just been written to ``padded``: look two sweeps later if need be."""
        self._since_look = min(self._since_look, self._interval - 2)

    @property
    def _interval(self) -> int:
        return INTERVALS[min(self._looks_since_cut, len(INTERVALS) - 1)]

    def restore_steps(self) -> None:
        """Let every contact have the step again that it began with."""
        self._fraction[:] = 1.0
        self._iterates.scale_steps(self._fraction)
        self._since_look, self._looks_since_cut = 0, 0

    def move_to(self, impulses: FloatArray) -> None:
        """Go on from ``impulses``, shape (n_rows,), with the step sizes as they have become."""
        self.padded[:] = self._iterates.layout.pad(impulses).reshape(-1)
        self._since_look = 0  # nothing is compared across the jump

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        return self._iterates.impulses()

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        return self._iterates.relative_velocity()


@njit(cache=True)
def _cut_where_opposed(width, sliding, groups, before, previous, newest, step_sizes, fraction):  # type: ignore[no-untyped-def]
    """Cut the step of every contact whose last two increments are opposed and do not shrink; return whether any was."""
    lanes, groups = uint64(width), uint64(groups)
    was_cut = False
    for i in range(uint64(len(fraction))):
        k = lanes * i
        product, older, newer, impulse = 0.0, 0.0, 0.0, 0.0
        for lane in range(lanes):
            r = step_sizes[groups * i + uint64(0 if lane == 0 else (1 if lane <= sliding else 2))]
            weight = 1.0 / r if r > 0.0 else 0.0
            a = previous[k + lane] - before[k + lane]
            b = newest[k + lane] - previous[k + lane]
            product += weight * a * b
            older += weight * a * a
            newer += weight * b * b
            impulse += weight * newest[k + lane] ** 2
        opposed = product < -OPPOSED * np.sqrt(older * newer)
        if opposed and newer > SHRINKS**2 * older and newer > ROUNDING**2 * impulse:
            fraction[i] = max(CUT * fraction[i], SMALLEST)
            was_cut = True
    return was_cut
