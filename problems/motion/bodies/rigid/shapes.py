"""Shapes of rigid bodies: boxes, half-spaces, convex polyhedra, spheres, capsules and cylinders."""

from dataclasses import dataclass
from functools import cached_property
from math import hypot, inf

import numpy as np

from ....arrays import FloatArray
from ....errors import ProblemError
from .polyhedron import Polyhedron
from .round_shapes import Capsule, Cylinder, Sphere, require_lengths


@dataclass(frozen=True)
class Box:
    """A box.

    Attributes:
        size: edge lengths along the body axes [m].

    Raises:
        ProblemError: if ``size`` does not contain three lengths in the range of ``require_lengths``.
    """

    size: tuple[float, ...]

    def __post_init__(self) -> None:
        if np.shape(self.size) != (3,):
            raise ProblemError(f"size of a box must be three edge lengths, got {self.size}.")
        for index, edge in enumerate(self.size):
            require_lengths("box", **{f"size[{index}]": edge})

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
        """Radius of the sphere about the centre of mass that contains the shape [m]."""
        return 0.5 * hypot(*self.size)

    @property
    def thickness(self) -> float:
        """Diameter of the largest sphere about the centre of mass inside the shape [m]."""
        return min(self.size)

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
    thickness = inf


Shape = Box | HalfSpace | Polyhedron | Sphere | Capsule | Cylinder


def check_shape(name: str, shape: object) -> None:
    """Check that ``shape`` is a shape; the error message calls it ``name``.

    Raises:
        ProblemError: if ``shape`` is not a shape.
    """
    if not isinstance(shape, Shape):
        hint = "; convex_polyhedron returns a shape and its pose" if isinstance(shape, tuple) else ""
        raise ProblemError(f"{name} must be a shape, such as Box((1, 1, 1)), got {type(shape).__name__}{hint}.")
