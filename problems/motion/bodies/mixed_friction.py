"""Friction coefficients that vary between pairs of bodies.

The coefficient of a pair, two balls or a ball and a surface, is computed from a hash of the pair's key and a seed
(SplitMix64: Steele, Lea & Flood, *Fast splittable pseudorandom number generators*, OOPSLA 2014). A pair
therefore keeps its coefficient from step to step, even if its bodies separate and touch again, and on all machines.
"""

from dataclasses import dataclass

import numpy as np

from ...arrays import FloatArray, IntArray
from ...errors import ProblemError

_GAMMA, _FIRST_FACTOR, _SECOND_FACTOR = (
    np.uint64(n) for n in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)
)
"""Constants of SplitMix64: the increment of the state, and the factors of the hash."""


@dataclass(frozen=True, eq=False)
class MixedFriction:
    """Uniformly distributed friction coefficients, one for each pair of bodies.

    A ``BallSystem`` accepts them as its friction.

    Attributes:
        lowest: smallest μ.
        highest: largest μ.
        seed: seed of the coefficients.

    Raises:
        ProblemError: unless 0 ≤ ``lowest`` ≤ ``highest`` < ∞ and 0 ≤ ``seed`` < 2⁶⁴.
    """

    lowest: float
    highest: float
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0.0 <= self.lowest <= self.highest < np.inf:
            raise ProblemError(
                f"friction must be a range of nonnegative numbers, lowest first, got {self.lowest} to {self.highest}."
            )
        if not 0 <= self.seed < 2**64:
            raise ProblemError(f"the seed of the coefficients must be from 0 to 2⁶⁴ − 1, got {self.seed}.")

    def __call__(self, pairs: IntArray) -> FloatArray:
        """Return μ of each contact from the keys of the pairs of bodies, both of shape (n_contacts,)."""
        with np.errstate(over="ignore"):
            bits = (pairs.astype(np.uint64) + np.uint64(1)) * _GAMMA + _hash(np.array([self.seed], dtype=np.uint64))
        fraction = (_hash(bits) >> np.uint64(11)).astype(np.float64) * 2.0**-53
        coefficients: FloatArray = self.lowest + (self.highest - self.lowest) * fraction
        return coefficients


def _hash(bits: np.ndarray[tuple[int], np.dtype[np.uint64]]) -> np.ndarray[tuple[int], np.dtype[np.uint64]]:
    """Return the 64-bit hash of each number."""
    with np.errstate(over="ignore"):
        bits = (bits ^ (bits >> np.uint64(30))) * _FIRST_FACTOR
        bits = (bits ^ (bits >> np.uint64(27))) * _SECOND_FACTOR
    return bits ^ (bits >> np.uint64(31))
