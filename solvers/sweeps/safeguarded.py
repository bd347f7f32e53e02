"""A safeguard for sweeps: the step of each contact that oscillates is reduced.

If friction pushes the bodies of a slipping planar contact apart, SORprox converges on this contact only if

    |1 − ω(1 + μ|G_NT|/G_NN)| < 1.

Contacts of high friction can cycle even if each is solved exactly, and it is unknown beforehand which contacts will
slip. All contacts therefore begin with the step of the method. At intervals, the last increment of each contact, d =
Λ^ν − Λ^(ν−1), is compared with the previous one, d'. If they are opposed and do not shrink, in the norm of √α Λ (the
contact's own scale of energy),

    dᵀd' < −OPPOSED ‖d‖ ‖d'‖      and      ‖d‖ > MAX_CONTRACTION_FACTOR ‖d'‖,

the step of the contact is reduced permanently. Contacts that converge keep their step, and a problem without
oscillation gets the same iterates as without the safeguard.
"""

from typing import Protocol

import numpy as np
from numba import njit, uint64

from ...problems.arrays import FloatArray
from ...problems.compilation.interpretation import interpretable
from ...problems.contact.blocks import BlockLayout
from ..iteration.loop import Iterates, WrappedIterates

INTERVALS = (19, 37, 73)
"""Numbers of sweeps between successive comparisons after a reduction, enough for it to take effect. They are prime, so
that comparisons meet a cycle of several iterates in different phases."""

OPPOSED = 0.5
"""Increments are opposed if the cosine of their angle is below minus this value."""

MAX_CONTRACTION_FACTOR = 0.9
"""Increments that shrink to this fraction or less per sweep are accepted."""

STEP_REDUCTION = 0.6
"""Factor by which a step is reduced."""

MIN_FRACTION = 1e-3
"""Smallest step, relative to the initial one."""

ROUNDING = 1e-14
"""Increments below this fraction of the impulse count as rounding errors, whatever their direction."""


class ScalableIterates(Iterates, Protocol):
    """Iterates whose steps can be scaled block by block.

    Attributes:
        layout: the padded blocks.
        padded: Λ padded and flat, which sweeps change in place.
    """

    layout: BlockLayout
    padded: FloatArray

    @property
    def step_sizes(self) -> FloatArray:
        """Initial r of the lanes of each block [kg], as in ``step_size``."""
        ...

    def scale_steps(self, fraction: FloatArray) -> None:
        """Set the step of each block to this fraction of its initial step, shape (n_blocks,)."""
        ...


class SafeguardedIterates(WrappedIterates[ScalableIterates]):
    """Iterates whose steps are reduced where contacts oscillate.

    Attributes:
        padded: Λ padded and flat, which sweeps change in place.
    """

    def __init__(self, iterates: ScalableIterates) -> None:
        self._iterates, self.padded = iterates, iterates.padded
        self._fraction = np.empty(iterates.layout.n_blocks)  # step of each contact, relative to its initial one
        self._fraction.fill(1.0)
        self._second_last_impulses, self._previous_impulses = np.empty((2, len(iterates.padded)))
        self._since_check, self._checks_since_reduction, self._interval = 0, 0, INTERVALS[0]

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps; compare increments at intervals and reduce steps where they oscillate."""
        newest_impulses = self.padded
        while count > 0:
            sweeps_left = self._interval - self._since_check
            if sweeps_left == 2:
                self._second_last_impulses[:] = newest_impulses
            elif sweeps_left == 1:
                self._previous_impulses[:] = newest_impulses
            step = min(count, sweeps_left - 2 if sweeps_left > 2 else 1)
            self._iterates.sweep(step)
            self._since_check += step
            count -= step
            if step == sweeps_left:
                self._since_check, self._checks_since_reduction = 0, self._checks_since_reduction + 1
                layout, step_sizes = self._iterates.layout, self._iterates.step_sizes
                lanes, step_sizes = (layout.width, layout.sliding, step_sizes.shape[1]), step_sizes.reshape(-1)
                if reduce_opposed_steps(
                    *lanes,
                    self._second_last_impulses,
                    self._previous_impulses,
                    newest_impulses,
                    step_sizes,
                    self._fraction,
                ):
                    self._checks_since_reduction = 0
                    self._iterates.scale_steps(self._fraction)
                self._interval = INTERVALS[min(self._checks_since_reduction, len(INTERVALS) - 1)]

    def note_jump(self) -> None:
        """Postpone the comparison, if necessary, so that no increment spans the jump of ``padded``."""
        self._since_check = min(self._since_check, self._interval - 2)

    def move_to(self, impulses: FloatArray) -> None:
        """Continue from ``impulses``, shape (n_rows,), with the current step sizes."""
        self.padded[:] = self._iterates.layout.pad(impulses).reshape(-1)
        self._since_check = 0  # no increment spans the jump


@interpretable
@njit(cache=True, error_model="numpy")
def reduce_opposed_steps(  # type: ignore[no-untyped-def]
    width, sliding, groups, second_last_impulses, previous_impulses, newest_impulses, step_sizes, fraction
):
    """Reduce the step of each contact whose increments are opposed and do not shrink; return whether there is one."""
    lanes, groups = uint64(width), uint64(groups)
    has_reduced_step = False
    for i in range(uint64(len(fraction))):
        k = lanes * i
        product, older, newer, impulse = 0.0, 0.0, 0.0, 0.0
        for lane in range(lanes):
            r = step_sizes[groups * i + uint64(0 if lane == 0 else (1 if lane <= sliding else 2))]
            weight = 1.0 / r if r > 0.0 else 0.0
            a = previous_impulses[k + lane] - second_last_impulses[k + lane]
            b = newest_impulses[k + lane] - previous_impulses[k + lane]
            product += weight * a * b
            older += weight * a * a
            newer += weight * b * b
            impulse += weight * (newest_impulses[k + lane] * newest_impulses[k + lane])
        is_opposed = product < -OPPOSED * np.sqrt(older * newer)
        if is_opposed and newer > MAX_CONTRACTION_FACTOR**2 * older and newer > ROUNDING**2 * impulse:
            fraction[i] = max(STEP_REDUCTION * fraction[i], MIN_FRACTION)
            has_reduced_step = True
    return has_reduced_step
