"""Momentum for sweeps: each sweep starts further along the direction of the last change.

    y = Λ^ν + β (Λ^ν − Λ^(ν−1)),      Λ^(ν+1) = sweep(y)

Unlike Polyak's heavy-ball method, which it resembles, it sweeps from y, as Nesterov's method does. Observers receive
Λ, which a sweep has just projected, never y. If the direction turns back, (y − Λ^(ν+1))·(Λ^(ν+1) − Λ^ν) > 0, the next
sweep has no momentum, as in the restarts of O'Donoghue & Candès (Found. Comput. Math. 15, 2015). A change of the
active set then takes one sweep and does not overshoot. If the residual makes no progress, β is halved. All other state
of a sweep is affine in Λ and is extrapolated with it.

β may grow with the number k of sweeps so far, up to a bound:

    β_k = min(β, k/(k + d)).

Sweeps with momentum have a memory of 1/(1 − β) sweeps: the change of one sweep moves Λ by that many times its length in
total. A solve that ends after k sweeps gains nothing from a memory longer than a fraction of k. The best constant β
therefore depends on the tolerance and on the number of contacts. With β_k the memory is 1 + k/d, about the same
fraction of k for any k, as in accelerated gradient methods (Su, Boyd & Candès, J. Mach. Learn. Res. 17, 2016).

The bound may follow the measured rate of convergence (``measured_momentum``).

``RestartedMomentum`` chooses β itself, by Nesterov's sequence (1983) with k sweeps since the last restart:

    β_k = (t_k − 1)/t_(k+1),      t_(k+1) = (1 + √(1 + 4t_k²))/2,      t_1 = 1.

For a convex function with curvatures from m to L, the best β is (√L − √m)/(√L + √m), which is unknown. β_k grows
towards 1. Once it exceeds the best β, the iterates turn back and t restarts at 1, so that β is near the best value on
average. Sweeps are not gradient steps, however: on redundant joints, the changes may grow without turning back.
Therefore t also restarts if a sweep moves Λ a hundred times as far as the shortest sweep since the last restart.
"""

from collections.abc import Callable, Sequence
from typing import Literal, Protocol

import numpy as np
from numba import njit, uint64

from ...problems.arrays import FloatArray
from .loop import Iterates, MeasuringIterates, WrappedIterates
from .measured_momentum import DELAY, MeasuredMomentum
from .method import check_option

MEASURED: Literal["measured"] = "measured"
"""Value of the option ``momentum`` with which β follows the measured rate of convergence."""

Momentum = float | Literal["measured"]
"""Type of the option ``momentum`` of a method."""

MIN_MOMENTUM = 0.3
"""A β up to this value is set to zero instead of being halved."""

NESTEROV_BOUND = 1.0
"""Bound of β for Nesterov's sequence, which stays below it anyway."""

GROWTH = 100.0
"""The sequence restarts if a sweep moves Λ more than this many times as far as the shortest sweep since the last
restart."""


def check_momentum(momentum: object, delay: object) -> None:
    """Raise ``SolverError`` unless β is measured or 0 ≤ β < 1, and d is finite, at least 0, and 0 for measured β."""
    is_measured = isinstance(momentum, str) and momentum == MEASURED
    is_valid = is_measured or (isinstance(momentum, int | float) and 0.0 <= momentum < 1.0)
    check_option("momentum", momentum, is_valid, "a number from 0 to below 1, or 'measured'")
    is_valid = isinstance(delay, int | float) and 0.0 <= delay < np.inf
    check_option("momentum_delay", delay, is_valid, "a number of at least 0")
    check_option("momentum_delay", delay, not (is_measured and delay), "0 with momentum='measured'")


class LinearIterates(Iterates, Protocol):
    """Iterates that can be moved along a direction between two sweeps."""

    def linear_state(self) -> tuple[FloatArray, int]:
        """Return the array that sweeps change in place, affine in Λ, and how many of its first entries are Λ."""
        ...


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def momentum_after(sweeps, momentum, delay):  # type: ignore[no-untyped-def]
    """Return β after k ≥ 1 sweeps: min(β, k/(k + d)), which is β itself for d = 0."""
    return min(momentum, sweeps / (sweeps + delay))


@njit(cache=True, fastmath={"contract"}, inline="always")
def extrapolate(velocity, previous_velocity, beta, begin, end):  # type: ignore[no-untyped-def]
    """Move v from ``begin`` to ``end`` by β = ``beta`` times its last change, and keep the old v."""
    for k in range(uint64(begin), uint64(end)):
        v = velocity[k]
        velocity[k] = v + beta * (v - previous_velocity[k])
        previous_velocity[k] = v


class MomentumState(MeasuringIterates):
    """β of iterates with momentum, at least 0 and below 1.

    Args:
        momentum: bound of β.
        delay: d, the number of sweeps after which β may be one half; 0 for a constant β.
    """

    def __init__(self, momentum: float, delay: float = 0.0) -> None:
        self._momentum, self._beta = momentum, 0.0  # bound of β, and β of the next sweep
        self._delay, self._sweeps = delay, 0
        self._measured: MeasuredMomentum | None = None

    def follow_residuals(self) -> None:
        """Make the bound of β follow the measured rate of convergence."""
        self._measured = MeasuredMomentum()
        self._momentum, self._delay = self._measured.bound, DELAY

    def note_residual(self, residual: float) -> None:
        """Record the residual of the current Λ."""
        if self._measured is not None:
            self._measured.record_residual(self._sweeps, residual)
            self._momentum = self._measured.bound

    @property
    def sweeps_to_change(self) -> float:
        """Number of sweeps after which a residual may change the bound of β; infinite if none does."""
        return np.inf if self._measured is None else self._measured.next_change - self._sweeps

    def count_window(self, counts: Sequence[int], residuals: FloatArray) -> None:
        """Count the sweeps of a window, and record its residuals before the last one."""
        sweeps = self._sweeps
        self._sweeps += sum(counts)
        if self._measured is not None:
            for count, residual in zip(counts, residuals, strict=False):
                sweeps += count
                self._measured.record_residual(sweeps, float(residual))

    def reduce_acceleration(self) -> bool:
        """Halve β, or set it to zero when it is small; return False if it is zero already.

        From then on, the bound no longer follows the residuals.
        """
        if self._measured is not None:
            self._momentum, self._measured = min(self._momentum, MeasuredMomentum().bound), None
        if self._momentum == 0.0:
            return False
        self._momentum = 0.5 * self._momentum if self._momentum > MIN_MOMENTUM else 0.0
        self._beta = min(self._beta, self._momentum)
        return True


class MomentumIterates(MomentumState, WrappedIterates[LinearIterates]):
    """Sweeps with momentum β."""

    def __init__(self, iterates: LinearIterates, momentum: float, delay: float = 0.0) -> None:
        super().__init__(momentum, delay)
        self._iterates = iterates
        self._array, self._n_impulses = iterates.linear_state()
        self._previous, self._change = np.empty_like(self._array), np.zeros_like(self._array)

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps."""
        for _ in range(count):
            _extrapolate(self._array, self._previous, self._change, self._beta)
            self._iterates.sweep(1)
            turns_back, squared_step = _update_change(
                self._array, self._previous, self._change, self._beta, self._n_impulses
            )
            self._sweeps += 1
            self._beta = self._next_momentum(turns_back, squared_step)

    def _next_momentum(self, turns_back: bool, squared_step: float) -> float:
        """Return β of the next sweep; ``squared_step`` is ‖ΔΛ‖² of the last sweep, which may have turned back."""
        return 0.0 if turns_back else momentum_after(self._sweeps, self._momentum, self._delay)


class RestartedMomentum(MomentumIterates):
    """Sweeps with Nesterov's sequence of β, restarted when the iterates turn back."""

    def __init__(self, iterates: LinearIterates) -> None:
        super().__init__(iterates, NESTEROV_BOUND)
        self._term, self._min_squared_step = 1.0, np.inf

    def _next_momentum(self, turns_back: bool, squared_step: float) -> float:
        restarts = turns_back or squared_step > GROWTH**2 * self._min_squared_step
        self._min_squared_step = squared_step if restarts else min(self._min_squared_step, squared_step)
        term, self._term = self._term, 1.0 if restarts else 0.5 + np.sqrt(0.25 + self._term**2)
        return 0.0 if restarts else min((term - 1.0) / self._term, self._momentum)


def with_momentum(iterates: LinearIterates, momentum: float, delay: float) -> Iterates:
    """Return the iterates with momentum β, delayed by ``delay``, or the iterates themselves if β = 0."""
    return MomentumIterates(iterates, momentum, delay) if momentum > 0.0 else iterates


def begin_with_momentum(
    begin: Callable[[FloatArray, float, float], Iterates], momentum: Momentum, delay: float
) -> Callable[[FloatArray], Iterates]:
    """Return the function that begins iterates at Λ, shape (n_rows,), with the options of a method."""
    if not isinstance(momentum, str):
        return lambda start: begin(start, momentum, delay)

    def begin_measured(start: FloatArray) -> Iterates:
        iterates = begin(start, MeasuredMomentum().bound, DELAY)
        assert isinstance(iterates, MomentumState)
        iterates.follow_residuals()
        return iterates

    return begin_measured


@njit(cache=True, fastmath={"contract"})
def _extrapolate(array, previous_array, change, momentum):  # type: ignore[no-untyped-def]
    """Copy ``array`` to ``previous_array`` and move it along its last change."""
    for k in range(len(array)):
        previous_array[k] = array[k]
        array[k] += momentum * change[k]


@njit(cache=True, fastmath={"contract", "reassoc"})
def _update_change(array, previous_array, change, momentum, n_impulses):  # type: ignore[no-untyped-def]
    """Update ``change``; return whether (y − Λ^(ν+1))·(Λ^(ν+1) − Λ^ν) > 0 for the start y of the sweep, and ‖ΔΛ‖²."""
    total, squared_step = 0.0, 0.0
    for k in range(n_impulses):
        step = array[k] - previous_array[k]
        total += (momentum * change[k] - step) * step
        squared_step += step * step
        change[k] = step
    for k in range(n_impulses, len(array)):
        change[k] = array[k] - previous_array[k]
    return total > 0.0, squared_step
