"""A semicircular masonry arch of equal stones between two fixed blocks.

The arch stands if it is thick enough, t/R above a limit that depends on its n stones and on μ. With μ > 0.396 it
collapses by hinges, and the limit rises with n to 0.1074. Below, hinges and sliding mix, up to t/R = 0.2006 at
μ = 0.309; with less friction no semicircular arch stands, however thick (Cocchetti & Rizzi 2020, *Analytical and
numerical analysis on the collapse modes of least-thickness circular masonry arches at decreasing friction*).

Joints are radial, at the angles π k/n. Stones are cut straight from joint to joint; for few of them the limit is a
little lower than for stones with round faces, whose centres of mass are farther out: 0.0957 and 0.0962 for n = 7.
"""

from dataclasses import dataclass
from math import cos, pi, sin

import numpy as np

from ....arrays import FloatArray
from ....errors import ProblemError
from ..scene import OVERLAP


@dataclass(frozen=True)
class Arch:
    """A semicircular arch in the plane (x, z) with its centre at the origin.

    Attributes:
        stones: n.
        thickness: t/R.
        friction: μ of all joints.
        radius: R of the centre line [m].
        width: along y [m].
        density: of the stones [kg/m³].
        gravity: g [m/s²].

    Raises:
        ProblemError: if there are fewer than two stones, or the thickness is outside (0, 1).
    """

    stones: int = 7
    thickness: float = 0.11
    friction: float = 0.8
    radius: float = 1.0
    width: float = 0.3
    density: float = 2400.0
    gravity: float = 9.81

    def __post_init__(self) -> None:
        if self.stones < 2:
            raise ProblemError(f"stones of an arch must be at least 2, got {self.stones}.")
        if not 0.0 < self.thickness < 1.0:
            raise ProblemError(
                f"thickness of an arch must be between 0 and 1, in centre-line radii; got {self.thickness}."
            )

    def joint(self, index: int) -> FloatArray:
        """Return the corners of a joint [m], two inner and two outer ones, shape (4, 3).

        Joint 0 is the springing at x > 0, joint n the one at x < 0.
        """
        angle = pi * index / self.stones
        radii = self.radius * (1.0 + 0.5 * self.thickness * np.array([-1.0, -1.0, 1.0, 1.0]))
        y = 0.5 * self.width * np.array([-1.0, 1.0, -1.0, 1.0])
        return np.column_stack([radii * cos(angle), y, radii * sin(angle)])

    def normal(self, index: int) -> FloatArray:
        """Return the unit normal of a joint from stone ``index`` − 1 to the next one, shape (3,)."""
        angle = pi * index / self.stones
        return np.array([-sin(angle), 0.0, cos(angle)])

    def corners(self, stone: int) -> FloatArray:
        """Return the corners of a stone [m], shape (8, 3), which passes each of its joints by half of ``OVERLAP``."""
        excess = 0.5 * OVERLAP
        first = self.joint(stone) - excess * self.normal(stone)
        return np.concatenate([first, self.joint(stone + 1) + excess * self.normal(stone + 1)])
