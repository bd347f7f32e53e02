"""A sphere and a cylinder that roll to rest on level ground under rolling resistance."""

from abc import abstractmethod
from dataclasses import dataclass
from math import sqrt
from typing import ClassVar

import numpy as np

from ....errors import ProblemError
from ...bodies.balls import DISC_INERTIA, SPHERE_INERTIA
from ...bodies.rigid.orientation import IDENTITY, Y_AXIS, Z_AXIS, about, product
from ...bodies.rigid.rigid_bodies import RigidBodies
from ...bodies.rigid.round_shapes import Cylinder, Sphere
from ...bodies.rigid.shapes import Shape
from ...state import State
from ..effects import Friction, Gravity
from ..scene import OVERLAP, ClosedFormScene, check_positive
from .boxes import incline
from .effects import RollingResistance, rigid_bodies


class RollingBody(ClosedFormScene):
    """A round body that rolls along x without slip until its rolling resistance stops it.

    Attributes:
        inertia_factor: J/(m r²) about the axis of rolling.
        upright: initial orientation of the body, a unit quaternion.
        spin_axis: the axis about which the body rolls, in body axes.
    """

    speed: float
    resistance: float
    friction: float
    radius: float
    mass: float
    gravity: float

    inertia_factor: ClassVar[float]
    upright: ClassVar[tuple[float, float, float, float]]
    spin_axis: ClassVar[tuple[float, float, float]]

    @property
    def deceleration(self) -> float:
        """Deceleration of the centre [m/s²], μ_r g/(r (1 + J/(m r²))).

        This is r times the moment μ_r m g, divided by the inertia m r² + J about the line of contact.
        """
        return self.resistance * self.gravity / (self.radius * (1.0 + self.inertia_factor))

    @property
    def stop_time(self) -> float:
        """Time at which the body comes to rest [s]."""
        return self.speed / self.deceleration

    def check(self) -> None:
        """Raise ``ProblemError`` if a number is not positive, or friction is too low for rolling."""
        check_positive(self, "a rolling body", "speed", "resistance", "radius", "mass", "gravity")
        if self.friction * self.gravity < self.deceleration:
            least_friction = self.deceleration / self.gravity
            raise ProblemError(
                f"friction of a rolling body must be at least {least_friction:.4g}, got {self.friction}; increase it."
            )

    @abstractmethod
    def shape(self) -> Shape:
        """Return the shape of the body."""

    def system(self) -> RigidBodies:
        """Return the body on the ground z = 0."""
        effects = (Gravity(self.gravity), Friction(self.friction), RollingResistance(self.resistance))
        return rigid_bodies([self.shape()], np.array([self.mass]), [incline(0.0)], effects)

    def exact(self, time: float) -> State:
        """Return the state at ``time`` [s]: uniform deceleration, then rest."""
        rolling = min(time, self.stop_time)
        distance = self.speed * rolling - 0.5 * self.deceleration * rolling**2
        speed = self.speed - self.deceleration * rolling
        orientation = product(about(Y_AXIS, distance / self.radius)[None], np.array([self.upright]))[0]
        spin = speed / self.radius * np.array(self.spin_axis)
        centre = np.array([distance, 0.0, self.radius - OVERLAP])
        return State(time, np.concatenate([centre, orientation]), np.concatenate([[speed, 0.0, 0.0], spin]))


@dataclass(frozen=True)
class RollingSphere(RollingBody):
    """A homogeneous sphere that rolls to rest.

    Attributes:
        speed: initial velocity along x [m/s].
        resistance: μ_r [m].
        friction: μ.
        radius: r [m].
        mass: m [kg].
        gravity: g [m/s²].

    Raises:
        ProblemError: if a number is not positive, or friction is too low for rolling.
    """

    speed: float = 1.0
    resistance: float = 0.01
    friction: float = 0.5
    radius: float = 0.1
    mass: float = 1.0
    gravity: float = 9.81

    inertia_factor = SPHERE_INERTIA
    upright = IDENTITY
    spin_axis = Y_AXIS

    def __post_init__(self) -> None:
        self.check()

    def shape(self) -> Shape:
        """Return the sphere."""
        return Sphere(self.radius)


@dataclass(frozen=True)
class RollingCylinder(RollingBody):
    """A homogeneous cylinder on its side that rolls to rest.

    Attributes:
        speed: initial velocity along x [m/s].
        resistance: μ_r [m].
        friction: μ.
        radius: r [m].
        length: length along its axis [m].
        mass: m [kg].
        gravity: g [m/s²].

    Raises:
        ProblemError: if a number is not positive, or friction is too low for rolling.
    """

    speed: float = 1.0
    resistance: float = 0.01
    friction: float = 0.5
    radius: float = 0.1
    length: float = 0.3
    mass: float = 1.0
    gravity: float = 9.81

    inertia_factor = DISC_INERTIA
    upright = (sqrt(0.5), -sqrt(0.5), 0.0, 0.0)
    spin_axis = Z_AXIS

    def __post_init__(self) -> None:
        self.check()

    def shape(self) -> Shape:
        """Return the cylinder."""
        return Cylinder(self.radius, self.length)
