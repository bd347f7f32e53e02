"""Momentum for sweeps: each begins a little further along the way that the last one went.

    y = Λ^ν + β (Λ^ν − Λ^(ν−1)),      Λ^(ν+1) = sweep(y)

(Polyak's heavy ball on Gauss–Seidel sweeps). What is seen is always Λ, which a sweep has just projected, never y. Where
the way turns back, (y − Λ^(ν+1))·(Λ^(ν+1) − Λ^ν) > 0, the next sweep begins without momentum (as O'Donoghue & Candès
2015 restart Nesterov's method), so that a change of the active set costs one sweep and no overshooting; where the
residual makes no progress, β is halved. Everything that a sweep keeps beside Λ is linear in Λ, and is carried along.
"""

from typing import Protocol

import numpy as np
from numba import njit

from ...problems.arrays import FloatArray
from .loop import Accelerated, Iterates


def with_momentum(iterates: "LinearIterates", momentum: float) -> Iterates:
    """Return the iterates with momentum β, themselves if it is 0."""
    return MomentumIterates(iterates, momentum) if momentum > 0.0 else iterates


class LinearIterates(Iterates, Protocol):
    """Iterates that may be moved along a direction between two sweeps."""

    def linear(self) -> tuple[FloatArray, int]:
        """Return the one array that sweeps change in place, linear in Λ up to a constant, and how much of it is Λ."""
        ...


class MomentumIterates(Accelerated):
    """The iterates of sweeps with momentum."""

    def __init__(self, iterates: LinearIterates, momentum: float) -> None:
        super().__init__(momentum)
        self._iterates = iterates
        self._array, self._n_impulses = iterates.linear()
        self._before, self._change = np.empty_like(self._array), np.zeros_like(self._array)

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps."""
        for _ in range(count):
            _extrapolate(self._array, self._before, self._change, self._present)
            self._iterates.sweep(1)
            turns, moved = _turn(self._array, self._before, self._change, self._present, self._n_impulses)
            self._present = self._next(turns, moved)

    def _next(self, turns: bool, moved: float) -> float:
        """Return β of the coming sweep, after one that ``turns`` back or does not, and changes Λ by √``moved``."""
        return 0.0 if turns else self._momentum

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        return self._iterates.impulses()

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        return self._iterates.relative_velocity()


@njit(cache=True, fastmath={"contract"})
def _extrapolate(array, before, change, momentum):  # type: ignore[no-untyped-def]
    """Keep ``array`` in ``before`` and move it along its last change."""
    for k in range(len(array)):
        before[k] = array[k]
        array[k] += momentum * change[k]


@njit(cache=True, fastmath={"contract", "reassoc"})
def _turn(array, before, change, momentum, n_impulses):  # type: ignore[no-untyped-def]
    """Renew ``change``; return whether (y − Λ^(ν+1))·(Λ^(ν+1) − Λ^ν) > 0, y being where the sweep began, and ‖ΔΛ‖²."""
    total, moved = 0.0, 0.0
    for k in range(n_impulses):
        step = array[k] - before[k]
        total += (momentum * change[k] - step) * step
        moved += step * step
        change[k] = step
    for k in range(n_impulses, len(array)):
        change[k] = array[k] - before[k]
    return total > 0.0, moved
