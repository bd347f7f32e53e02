"""Balls whose pairs have friction coefficients of their own.

The coefficient of a pair, two balls or a ball and a surface, is drawn by a hash of the pair's key and a seed
(SplitMix64: Steele, Lea & Flood, *Fast splittable pseudorandom number generators*, OOPSLA 2014). So a pair keeps its
coefficient from step to step, also where it parts and meets again, and has the same on every machine.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...arrays import FloatArray, IntArray
from ...contact.laws import Laws
from ...errors import ProblemError
from .balls import BallSystem
from .system import Overlaps, StepAssembly

_GAMMA, _FIRST, _SECOND = (np.uint64(n) for n in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB))


@dataclass(frozen=True, eq=False)
class MixedFriction:
    """A system of balls with friction, each pair of bodies with a coefficient of its own.

    Attributes:
        balls: the system; its own coefficient is not used.
        lowest: least μ.
        highest: largest μ; in between all are equally likely.
        seed: of the coefficients.

    Raises:
        ProblemError: for balls without friction, or a range that is none.
    """

    balls: BallSystem
    lowest: float
    highest: float
    seed: int = 0

    def __post_init__(self) -> None:
        if self.balls.friction is None:
            raise ProblemError("balls without friction cannot have coefficients of friction; give them one.")
        if not 0.0 <= self.lowest <= self.highest < np.inf:
            raise ProblemError(f"friction must range upwards from 0 or more, got {self.lowest} to {self.highest}.")
        if not 0 <= self.seed < 2**64:
            raise ProblemError(f"the seed of the coefficients must be from 0 to 2⁶⁴ − 1, got {self.seed}.")

    def coefficients(self, keys: IntArray) -> FloatArray:
        """Return μ of the contacts with these keys, shape (n_contacts,)."""
        with np.errstate(over="ignore"):
            bits = (keys.astype(np.uint64) + np.uint64(1)) * _GAMMA + _mixed(np.array([self.seed], dtype=np.uint64))
        share = (_mixed(bits) >> np.uint64(11)).astype(np.float64) * 2.0**-53
        coefficients: FloatArray = self.lowest + (self.highest - self.lowest) * share
        return coefficients

    def move(self, position: FloatArray, velocity: FloatArray, seconds: float) -> FloatArray:
        """Return q + u · seconds."""
        return self.balls.move(position, velocity, seconds)

    def assemble(self, midpoint: FloatArray, velocity: FloatArray, seconds: float) -> StepAssembly:
        """Linearise at q_M, as the balls do, with the laws of each pair."""
        assembly = self.balls.assemble(midpoint, velocity, seconds)
        contacts = assembly.contacts
        if contacts is None:
            return assembly
        laws = Laws.contacts(self.coefficients(contacts.keys), contacts.width, len(contacts.keys))
        return replace(assembly, contacts=replace(contacts, laws=laws))

    def gaps_below(self, position: FloatArray, limit: float) -> tuple[IntArray, FloatArray]:
        """Return keys, ascending, and gaps [m] of the contacts with g(q) < ``limit``."""
        return self.balls.gaps_below(position, limit)

    def overlaps(self, position: FloatArray, tolerated: float) -> Overlaps | None:
        """Return the contacts with g(q) < 0, or None if none of them is deeper than ``tolerated`` [m]."""
        return self.balls.overlaps(position, tolerated)


def _mixed(bits: np.ndarray[tuple[int], np.dtype[np.uint64]]) -> np.ndarray[tuple[int], np.dtype[np.uint64]]:
    """Return the bits, 64 of each number, well mixed."""
    with np.errstate(over="ignore"):
        bits = (bits ^ (bits >> np.uint64(30))) * _FIRST
        bits = (bits ^ (bits >> np.uint64(27))) * _SECOND
    return bits ^ (bits >> np.uint64(31))
