"""A semicircular masonry arch of equal stones on the ground.

An arch of n stones, thickness t and radius R stands if t/R exceeds a limit, which depends on n and on the friction
coefficient μ of its joints. For μ > 0.396 a thinner arch collapses by hinging, and the limit increases with n to
0.1074. For smaller μ it collapses by hinging and sliding, and the limit increases with decreasing μ, to 0.2006 at
μ = 0.309. With less friction no semicircular arch stands (Cocchetti & Rizzi 2020, *Analytical and numerical analysis
on the collapse modes of least-thickness circular masonry arches at decreasing friction*).

Joints are radial, at the angles π k/n. The inner and outer faces of the stones are plane. Round faces would move the
centres of mass outwards. With few stones, the limit for plane faces is therefore slightly lower: for n = 7 it is
0.0957, instead of 0.0962 for round faces.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, pi, sin

import numpy as np

from ....arrays import FloatArray
from ....errors import ProblemError
from ..scene import check_positive
from .prisms import PrismScene


@dataclass(frozen=True)
class Arch(PrismScene):
    """A semicircular arch in the plane (x, z) with its centre at the origin; stone 0 stands on the ground at x > 0.

    Attributes:
        stones: number of stones n.
        thickness: t/R, thickness divided by the radius.
        friction: μ of all joints.
        radius: R of the centre line [m].
        width: width along y [m].
        density: density of the stones [kg/m³].
        gravity: g [m/s²].
        overlap: initial penetration of each contact divided by R.

    Raises:
        ProblemError: if there are fewer than two stones, the thickness is outside (0, 1), the overlap is outside
            [0, 0.01), or a length or the density is not positive.
    """

    stones: int = 7
    thickness: float = 0.11
    friction: float = 0.8
    radius: float = 1.0
    width: float = 0.3
    density: float = 2400.0
    gravity: float = 9.81
    overlap: float = 1e-5

    def __post_init__(self) -> None:
        if self.stones < 2:
            raise ProblemError(f"the number of stones of an arch must be at least 2, got {self.stones}.")
        if not 0.0 < self.thickness < 1.0:
            raise ProblemError(f"thickness of an arch must be between 0 and 1, got {self.thickness}.")
        check_positive(self, "an arch", "radius", "width", "density")
        if not 0.0 <= self.overlap < 0.01:
            raise ProblemError(f"overlap of an arch must be at least 0 and less than 0.01, got {self.overlap}.")

    def joint(self, index: int) -> FloatArray:
        """Return the inner and the outer end (x, z) of a joint [m], in rows, shape (2, 2); joint 0 is below stone 0."""
        angle = pi * index / self.stones
        radii = self.radius * (1.0 + 0.5 * self.thickness * np.array([-1.0, 1.0]))
        return np.outer(radii, [cos(angle), sin(angle)])

    def normal(self, index: int) -> FloatArray:
        """Return the unit normal (x, z) of a joint, from stone ``index`` − 1 to stone ``index``, shape (2,)."""
        angle = pi * index / self.stones
        return np.array([-sin(angle), cos(angle)])

    def sections(self) -> Sequence[FloatArray]:
        """Return the corners (x, z) of each stone [m], shape (4, 2) each.

        Stones extend beyond each of their joints by half of the overlap.
        """
        excess = 0.5 * self.overlap * self.radius
        begins = [self.joint(index) - excess * self.normal(index) for index in range(self.stones)]
        ends = [self.joint(index) + excess * self.normal(index) for index in range(1, self.stones + 1)]
        return [np.concatenate([begin, end]) for begin, end in zip(begins, ends, strict=True)]
