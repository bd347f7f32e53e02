"""Momentum whose memory follows the measured rate of convergence.

Sweeps with momentum β have a memory of the last m = 1/(1 − β) sweeps. If sweeps without momentum reduce a mode of the
error by a small fraction δ per sweep, its amplitude z with momentum obeys z_{k+1} = (1 − δ)(z_k + β (z_k − z_{k−1})).
The characteristic roots are real if 4δm² < 1:

    4δm² < 1    the error falls by the factor exp(−δm) per sweep, so twice the memory doubles the rate
    4δm² = 1    this mode falls fastest, by the factor of about exp(−1/(2m)) per sweep
    4δm² > 1    the error oscillates and falls by √β ≈ exp(−1/(2m)), so a longer memory is slower

Let s be the measured rate, the decrease of the logarithm of the residual per sweep. The first case holds if s = δm is
below 1/(4m), that is, if the residual falls by less than the factor e in 4m sweeps. Then m is doubled. The slow modes
of a linear problem then fall twice as fast. If the next 4m sweeps gain less than half as much per sweep as the sweeps
before, the sweeps were slow because contacts change between open, stick and slip. A long memory delays such changes.
Then m returns to its first value, and the next trial waits twice as long as the last one.

After k sweeps, the memory is at most 1 + k/d, because a solve that ends after k sweeps gains nothing from a longer one.
"""

from math import log

import numpy as np

FIRST_MEMORY, MAX_MEMORY = 5.0, 67.0
"""The initial memory (β = 0.8), and the largest one (β = 0.985)."""

DELAY = 4.0
"""d, the number of sweeps after which β may be one half."""

MEMORIES_PER_WINDOW = 4.0
"""Number of sweeps in a window, relative to the memory; slow modes fall by less than the factor e in this window."""

GROWTH = 2.0
"""Factor by which the memory and the waiting time grow."""

MIN_RATIO = 0.5
"""Ratio of the rates after and before a growth below which the memory returns to its first value."""


class MeasuredMomentum:
    """Bound of β that follows the residuals of one solve."""

    def __init__(self) -> None:
        self._memory, self._pause = FIRST_MEMORY, 1.0
        self._best, self._window_begin = np.inf, (0, np.inf)  # sweeps and best residual at the beginning of the window
        self._rate_before: float | None = None  # rate before the last growth of the memory, during its trial

    @property
    def bound(self) -> float:
        """The current bound of β."""
        return 1.0 - 1.0 / self._memory

    @property
    def next_change(self) -> float:
        """The number of sweeps from which a residual may change the memory; 0 before the first residual."""
        return self._window_begin[0] + self._window if self._window_begin[1] < np.inf else 0.0

    @property
    def _window(self) -> float:
        """Number of sweeps between two possible changes of the memory."""
        return MEMORIES_PER_WINDOW * self._memory * (self._pause if self._memory == FIRST_MEMORY else 1.0)

    def record_residual(self, sweeps: int, residual: float) -> None:
        """Record the residual after a number of sweeps, and change the memory if a window ends there."""
        self._best = min(self._best, residual)
        begin, best = self._window_begin
        if best == np.inf:
            self._window_begin = sweeps, self._best
            return
        if sweeps - begin < self._window or self._best <= 0.0:
            return
        rate = log(best / self._best) / (sweeps - begin)
        rate_before, self._rate_before = self._rate_before, None
        if rate_before is not None and rate <= MIN_RATIO * rate_before:
            self._memory, self._pause = FIRST_MEMORY, GROWTH * self._pause
        elif rate * MEMORIES_PER_WINDOW * self._memory < 1.0 and self._memory < MAX_MEMORY:
            self._rate_before, self._memory = rate, min(GROWTH * self._memory, MAX_MEMORY)
        self._window_begin = sweeps, self._best
