"""Round shapes of rigid bodies: spheres, capsules and cylinders; their axis is the z axis of the body."""

from dataclasses import dataclass
from math import hypot, isfinite, pi

import numpy as np

from ....arrays import FloatArray
from ....errors import ProblemError

MIN_LENGTH, MAX_LENGTH = 1e-30, 1e30
"""Range of lengths [m] in which moments of inertia, proportional to fifth powers, neither underflow nor overflow."""


@dataclass(frozen=True)
class Sphere:
    """A ball.

    Attributes:
        radius: r [m].

    Raises:
        ProblemError: if the radius is not between ``MIN_LENGTH`` and ``MAX_LENGTH``.
    """

    radius: float

    def __post_init__(self) -> None:
        require_lengths("sphere", radius=self.radius)

    @property
    def volume(self) -> float:
        """Volume [m³]."""
        return 4.0 / 3.0 * pi * self.radius**3

    @property
    def inertia(self) -> FloatArray:
        """Principal moments of inertia for a density of 1 [m⁵], shape (3,)."""
        return np.full(3, 0.4 * self.volume * self.radius**2)

    @property
    def bounding_radius(self) -> float:
        """Radius of the sphere about the centre of mass that contains the shape [m]."""
        return self.radius

    @property
    def thickness(self) -> float:
        """Diameter of the largest sphere about the centre of mass inside the shape [m]."""
        return 2.0 * self.radius


@dataclass(frozen=True)
class Capsule:
    """The points within a radius of a segment of the z axis.

    Attributes:
        radius: r [m].
        length: length of the segment, without the caps [m].

    Raises:
        ProblemError: if a length is not between ``MIN_LENGTH`` and ``MAX_LENGTH``.
    """

    radius: float
    length: float

    def __post_init__(self) -> None:
        require_lengths("capsule", radius=self.radius, length=self.length)

    @property
    def volume(self) -> float:
        """Volume [m³]."""
        return pi * self.radius**2 * (self.length + 4.0 / 3.0 * self.radius)

    @property
    def inertia(self) -> FloatArray:
        """Principal moments of inertia for a density of 1 [m⁵], shape (3,)."""
        r, half = self.radius, 0.5 * self.length
        barrel, caps = 2.0 * pi * r**2 * half, 4.0 / 3.0 * pi * r**3
        along = barrel * r**2 / 2.0 + caps * 0.4 * r**2
        # the centre of mass of a hemisphere is 3 r/8 from its base
        across = barrel * (r**2 / 4.0 + half**2 / 3.0) + caps * (0.4 * r**2 + half**2 + 0.75 * r * half)
        return np.array([across, across, along])

    @property
    def bounding_radius(self) -> float:
        """Radius of the sphere about the centre of mass that contains the shape [m]."""
        return self.radius + 0.5 * self.length

    @property
    def thickness(self) -> float:
        """Diameter of the largest sphere about the centre of mass inside the shape [m]."""
        return 2.0 * self.radius


@dataclass(frozen=True)
class Cylinder:
    """A circular cylinder about the z axis.

    Attributes:
        radius: r [m].
        length: distance between its flat ends [m].

    Raises:
        ProblemError: if a length is not between ``MIN_LENGTH`` and ``MAX_LENGTH``.
    """

    radius: float
    length: float

    def __post_init__(self) -> None:
        require_lengths("cylinder", radius=self.radius, length=self.length)

    @property
    def volume(self) -> float:
        """Volume [m³]."""
        return pi * self.radius**2 * self.length

    @property
    def inertia(self) -> FloatArray:
        """Principal moments of inertia for a density of 1 [m⁵], shape (3,)."""
        across = self.volume * (self.radius**2 / 4.0 + self.length**2 / 12.0)
        return np.array([across, across, self.volume * self.radius**2 / 2.0])

    @property
    def bounding_radius(self) -> float:
        """Radius of the sphere about the centre of mass that contains the shape [m]."""
        return hypot(self.radius, 0.5 * self.length)

    @property
    def thickness(self) -> float:
        """Diameter of the largest sphere about the centre of mass inside the shape [m]."""
        return min(2.0 * self.radius, self.length)


def require_lengths(shape: str, **lengths: object) -> None:
    """Check that lengths of a shape are numbers from ``MIN_LENGTH`` to ``MAX_LENGTH`` [m].

    Raises:
        ProblemError: if a length is out of range; the message names the first such length.
    """
    for name, value in lengths.items():
        if not (isinstance(value, float | int | np.floating | np.integer) and isfinite(value) and value > 0.0):
            raise ProblemError(f"{name} of a {shape} must be positive and finite, got {value!r}.")
        if not MIN_LENGTH <= value <= MAX_LENGTH:
            raise ProblemError(f"{name} of a {shape} must be {MIN_LENGTH:g} to {MAX_LENGTH:g} m, got {value:g}.")
