"""A house of cards: storeys of leaning pairs, with a level card between adjacent pairs.

A pair of thin cards that lean by α stands with μ ≥ ½ tan α. A load on top raises the limit towards tan α, so that
the lowest storey determines the friction that a house needs; ``equilibrium.least_friction`` computes it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, sin, tan

import numpy as np

from ....arrays import FloatArray
from ....errors import ProblemError
from ..scene import check_positive
from .prisms import PrismScene


@dataclass(frozen=True)
class CardHouse(PrismScene):
    """A house of cards in the plane (x, z), with one pair fewer in each storey than in the one below.

    Leaning cards are cut horizontally at both ends, and vertically where the cards of a pair meet, so that faces touch.
    Pairs come first, from left to right and from the lowest storey up, the left card first; then the level cards.

    Attributes:
        storeys: number of storeys.
        lean: α of a leaning card from the vertical [rad].
        friction: μ of all contacts.
        length: length of a card [m].
        thickness: thickness of a card [m].
        width: width of a card along y [m].
        density: density of the cards [kg/m³].
        gravity: g [m/s²].
        overlap: initial depth of each contact [m].

    Raises:
        ProblemError: if there is no storey, a number is out of range, or pairs would not fit beside each other.
    """

    storeys: int = 3
    lean: float = 0.35
    friction: float = 0.5
    length: float = 0.088
    thickness: float = 0.001
    width: float = 0.063
    density: float = 700.0
    gravity: float = 9.81
    overlap: float = 1e-6

    def __post_init__(self) -> None:
        if self.storeys < 1:
            raise ProblemError(f"storeys of a house of cards must be at least 1, got {self.storeys}.")
        check_positive(self, "a house of cards", "lean", "length", "thickness", "width", "density")
        if not 0.0 <= self.overlap < 0.1 * self.thickness:
            raise ProblemError(
                f"overlap of a house of cards must be below a tenth of its thickness, got {self.overlap}."
            )
        if self.lean > 0.5 or self.foot + 2.0 * self.base > self.length:
            raise ProblemError(f"pairs that lean by {self.lean} are too wide for cards of this length; lean them less.")

    @property
    def base(self) -> float:
        """Width of a leaning card at its foot [m]."""
        return self.thickness / cos(self.lean)

    @property
    def foot(self) -> float:
        """Distance between the feet of a pair [m]."""
        return 2.0 * self.length * sin(self.lean)

    @property
    def height(self) -> float:
        """Height of a pair [m]: the height where inner faces meet, plus the height of the upright faces above."""
        return self.length * cos(self.lean) + 0.5 * self.base / tan(self.lean)

    def leaning(self) -> FloatArray:
        """Return the corners (x, z) [m] of the left card of a pair that meets at x = 0 on z = 0, shape (5, 2)."""
        left, meeting = -0.5 * self.foot, self.length * cos(self.lean)
        top_x = -0.5 * self.base
        return np.array(
            [[left - self.base, 0.0], [left, 0.0], [0.0, meeting], [0.0, self.height], [top_x, self.height]]
        )

    def sections(self) -> Sequence[FloatArray]:
        """Return the corners (x, z) of each card [m]: leaning cards, shape (5, 2), then level cards, shape (4, 2)."""
        pitch, storey = self.length + 0.25 * self.base, self.height + self.thickness - 2.0 * self.overlap
        left = self.leaning() + np.array([0.5 * self.overlap, 0.0])
        right = left * np.array([-1.0, 1.0])
        half = 0.5 * np.array([self.length, self.thickness])
        level = half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        leaning, lying = [], []
        for below in range(self.storeys):
            n_pairs = self.storeys - below
            base = below * storey - self.overlap
            pair_centres = pitch * (np.arange(n_pairs) - 0.5 * (n_pairs - 1))
            for x in pair_centres:
                leaning += [card + np.array([x, base]) for card in (left, right)]
            middle = base + self.height + 0.5 * self.thickness - self.overlap
            lying += [level + np.array([x, middle]) for x in 0.5 * (pair_centres[:-1] + pair_centres[1:])]
        return [*leaning, *lying]
