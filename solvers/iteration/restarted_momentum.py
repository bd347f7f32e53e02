"""Momentum without a β to choose: Nesterov's sequence, begun again where the way turns back.

    y = Λ^ν + β_k (Λ^ν − Λ^(ν−1)),   Λ^(ν+1) = sweep(y),   β_k = (t_k − 1)/t_(k+1),   t_(k+1) = (1 + √(1 + 4t_k²))/2

with t_1 = 1, k sweeps after the last turn (Nesterov 1983). On a convex problem of strength m and curvature L the best β
is (√L − √m)/(√L + √m), which nobody knows. β_k grows towards 1, and is too large as soon as it is beyond the best one:
then the iterates turn back, (y − Λ^(ν+1))·(Λ^(ν+1) − Λ^ν) > 0, and t begins at 1 again. So β stays near the best one
in the mean (O'Donoghue & Candès, Found. Comput. Math. 15, 2015). Sweeps are no gradient steps, though. Over joints that
say the same twice they may grow without turning back: t begins again too where a sweep moves Λ a hundred times as far
as one since the last turn. Where the residual makes no progress β is bounded, by halves, as in ``momentum``.
"""

import numpy as np

from .momentum import LinearIterates, MomentumIterates

NO_BOUND = 1.0
"""β_k is below it anyway."""

GROWTH = 100.0
"""How many times as far as the shortest one since the last turn a sweep may move Λ."""


class RestartedMomentum(MomentumIterates):
    """The iterates of sweeps with momentum that is begun again where they turn back."""

    def __init__(self, iterates: LinearIterates) -> None:
        super().__init__(iterates, NO_BOUND)
        self._age, self._least = 1.0, np.inf

    def _next(self, turns: bool, moved: float) -> float:
        """Return β of the coming sweep; see ``MomentumIterates``."""
        turns = turns or moved > GROWTH**2 * self._least
        self._least = moved if turns else min(self._least, moved)
        before, self._age = self._age, 1.0 if turns else 0.5 + np.sqrt(0.25 + self._age**2)
        return 0.0 if turns else min((before - 1.0) / self._age, self._momentum)
