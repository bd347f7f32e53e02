"""A symmetric top that spins on its tip and precesses steadily about the vertical.

Let l be the distance of the centre of mass from the tip, A the moment of inertia about a transverse axis through the
tip, C that about its own axis, θ the tilt, and n the angular velocity along the axis. At constant tilt, the precession
Ω follows from

    A cos θ Ω² − C n Ω + m g l = 0,      real for C² n² ≥ 4 A m g l cos θ

(Goldstein, *Classical Mechanics*, section 5.7). The smaller root, about m g l/(C n), is the slow precession.

With the tip on a joint, the midpoint rule has order 2. On the ground it has order 1, because W in Wᵀ u_E = 0 is taken
at the midpoint, half a step before u_E.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import cos, pi, sin, sqrt

import numpy as np

from ....arrays import FloatArray
from ....errors import ProblemError
from ...bodies.rigid.joints import WORLD, Joint, RigidJoints
from ...bodies.rigid.orientation import Y_AXIS, Z_AXIS, about, product, rotation_matrices
from ...bodies.rigid.polyhedron import Polyhedron, convex_polyhedron
from ...bodies.rigid.rigid_bodies import FixedBody, RigidBodies
from ...bodies.rigid.shapes import HalfSpace
from ...state import State
from ..effects import Friction, Gravity
from ..scene import OVERLAP, ClosedFormScene, Observable, check_positive
from .effects import BodyEffect, GyroscopicMoment, rigid_bodies

SIDES = 12
"""Number of sides of the pyramid; its transverse moments of inertia are equal, like those of a cone."""


@dataclass(frozen=True)
class SpinningTop(ClosedFormScene):
    """A homogeneous pyramid that spins on its tip at the origin, and precesses at constant tilt.

    Attributes:
        spin: n, angular velocity about its own axis [rad/s].
        tilt: θ, of the axis from the vertical [rad].
        fast: whether the top precesses with the larger root Ω.
        friction: μ of the tip on the ground; None for a ball joint at the tip.
        radius: radius of the upper face [m].
        height: height of the upper face above the tip [m].
        mass: m [kg].
        gravity: g [m/s²].

    Raises:
        ProblemError: if a number is not positive, the tilt is π/2 or more, the upper face would reach the ground, the
            spin is too slow for a steady precession, or the tip would slide or lift.
    """

    spin: float = 70.0
    tilt: float = 0.4
    fast: bool = False
    friction: float | None = None
    radius: float = 0.2
    height: float = 0.25
    mass: float = 1.0
    gravity: float = 9.81

    depth = 1e-6

    def __post_init__(self) -> None:
        check_positive(self, "a spinning top", "spin", "tilt", "radius", "height", "mass", "gravity")
        if self.tilt >= 0.5 * pi or self.radius * sin(self.tilt) >= self.height * cos(self.tilt):
            raise ProblemError(f"the upper face of a top that tilts by {self.tilt} reaches the ground; tilt it less.")
        if self.spin < self.min_spin:
            raise ProblemError(
                f"spin of a top must be at least {self.min_spin:.4g} to precess steadily, got {self.spin}; raise it."
            )
        if self.friction is not None and self.holding_friction > self.friction:
            raise ProblemError(
                f"friction of a top must be at least {self.holding_friction:.4g} to hold its tip, got {self.friction}; "
                "increase it, or choose None for a ball joint."
            )

    @cached_property
    def _pyramid(self) -> tuple[Polyhedron, FloatArray]:
        """The top upright with its tip at the origin, and its pose (centre, quaternion), shape (7,)."""
        angles = 2.0 * pi * np.arange(SIDES) / SIDES
        rim = np.column_stack([self.radius * np.cos(angles), self.radius * np.sin(angles), np.full(SIDES, self.height)])
        return convex_polyhedron(np.vstack([np.zeros(3), rim]))

    @cached_property
    def _moments(self) -> tuple[float, float]:
        """Moments of inertia A about the tip and C about the axis [kg m²]."""
        shape, pose = self._pyramid
        axes = rotation_matrices(pose[None, 3:])[0]
        about_centre = self.mass / shape.volume * (axes**2 @ shape.inertia)
        return float(about_centre[0] + self.mass * self.lever**2), float(about_centre[2])

    @property
    def lever(self) -> float:
        """Distance l of the centre of mass from the tip [m]."""
        _, pose = self._pyramid
        return float(pose[2])

    @property
    def min_spin(self) -> float:
        """Smallest spin with a steady precession [rad/s]."""
        across, along = self._moments
        return sqrt(4.0 * across * self.mass * self.gravity * self.lever * cos(self.tilt)) / along

    @property
    def precession(self) -> float:
        """Angular velocity Ω of the precession [rad/s]."""
        across, along = self._moments
        a, b, c = across * cos(self.tilt), along * self.spin, self.mass * self.gravity * self.lever
        numerator = b + sqrt(b * b - 4.0 * a * c)
        return numerator / (2.0 * a) if self.fast else 2.0 * c / numerator  # without cancellation

    @property
    def holding_friction(self) -> float:
        """Ratio of friction to normal force at the tip, l sin θ Ω²/g: the centre of mass moves in a level circle."""
        return self.lever * sin(self.tilt) * self.precession**2 / self.gravity

    def system(self) -> RigidBodies:
        """Return the top on the ground z = 0, or on a joint at the origin."""
        shape, pose = self._pyramid
        effects: list[BodyEffect] = [Gravity(self.gravity), GyroscopicMoment()]
        if self.friction is not None:
            effects.append(Friction(self.friction))
            return rigid_bodies([shape], np.array([self.mass]), [FixedBody(HalfSpace())], effects)
        x, y, z = (-rotation_matrices(pose[None, 3:])[0].T @ pose[:3]).tolist()
        joints = RigidJoints([Joint("ball", 0, WORLD, (x, y, z))], 1, 1.0)
        return replace(rigid_bodies([shape], np.array([self.mass]), [], effects), joints=joints)

    def exact(self, time: float) -> State:
        """Return the state at ``time`` [s], rotated by Ω t about the vertical and (n − Ω cos θ) t about the axis."""
        own_spin = self.spin - self.precession * cos(self.tilt)
        _, pose = self._pyramid
        rotations = [about(Y_AXIS, self.tilt), about(Z_AXIS, own_spin * time), pose[3:]]
        orientation = about(Z_AXIS, self.precession * time)[None]
        for rotation in rotations:
            orientation = product(orientation, rotation[None])
        axis = np.array(
            [
                sin(self.tilt) * cos(self.precession * time),
                sin(self.tilt) * sin(self.precession * time),
                cos(self.tilt),
            ]
        )
        centre, rate = self.lever * axis, self.precession * np.array(Z_AXIS) + own_spin * axis
        velocity = np.concatenate([np.cross(rate, centre), rotation_matrices(orientation)[0].T @ rate])
        depth = 0.0 if self.friction is None else OVERLAP
        return State(time, np.concatenate([centre - depth * np.array(Z_AXIS), orientation[0]]), velocity)

    def axis_of(self, state: State) -> FloatArray:
        """Return the unit vector along the axis of the top, shape (3,)."""
        _, pose = self._pyramid
        upright = rotation_matrices(pose[None, 3:])[0]
        axis: FloatArray = rotation_matrices(state.position[None, 3:7])[0] @ upright[2]
        return axis

    def tilt_of(self, state: State) -> float:
        """Return the angle of the axis from the vertical [rad]."""
        x, y, z = self.axis_of(state)
        return float(np.arctan2(np.hypot(x, y), z))

    def momentum(self, state: State) -> float:
        """Return the angular momentum about the vertical through the tip [kg m²/s]."""
        shape, _ = self._pyramid
        moments = self.mass / shape.volume * shape.inertia
        about_centre = rotation_matrices(state.position[None, 3:7])[0] @ (moments * state.velocity[3:])
        return float(about_centre[2] + self.mass * np.cross(state.position[:3], state.velocity[:3])[2])

    @property
    def observables(self) -> Sequence[Observable]:
        """Tilt, and angular momentum about the vertical."""
        return (
            Observable("tilt", self.tilt_of, label="tilt [rad]", head="tilt"),
            Observable("momentum", self.momentum, label="vertical angular momentum [kg m²/s]", head="L_z"),
        )
