"""Shapes of rigid bodies: boxes, half-spaces and convex polyhedra."""

from dataclasses import dataclass
from functools import cached_property
from math import hypot, inf

import numpy as np

from ....arrays import FloatArray
from .polyhedron import Polyhedron


@dataclass(frozen=True)
class Box:
    """A box.

    Attributes:
        size: edge lengths along the body axes [m].
    """

    size: tuple[float, ...]

    @property
    def volume(self) -> float:
        """Volume [m³]."""
        return self.size[0] * self.size[1] * self.size[2]

    @property
    def inertia(self) -> FloatArray:
        """Principal moments of inertia for a density of 1 [m⁵], shape (3,)."""
        squares = np.square(self.size)
        moments: FloatArray = self.volume / 12.0 * (squares.sum() - squares)
        return moments

    @property
    def bounding_radius(self) -> float:
        """Radius of the sphere about the centre of mass that holds the shape [m]."""
        return 0.5 * hypot(*self.size)

    @cached_property
    def vertices(self) -> FloatArray:
        """Corners in body axes [m], shape (8, 3)."""
        signs = np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)])
        corners: FloatArray = (signs - 0.5) * np.array(self.size)
        return corners


@dataclass(frozen=True)
class HalfSpace:
    """The half-space z < 0 of its body axes."""

    volume = inf
    inertia = (inf, inf, inf)
    bounding_radius = inf


Shape = Box | HalfSpace | Polyhedron
