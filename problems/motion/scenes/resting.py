"""Balls held by several contacts: a stack on the ground, and a ball in a V-groove, level or inclined."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, sin

import numpy as np

from ...arrays import FloatArray
from ...errors import ProblemError
from ..bodies.balls import BallSystem
from ..bodies.surfaces import Plane
from ..state import State
from .effects import Effect, Friction, Gravity, ball_system
from .inclines import RollingSphere
from .scene import GROUND, OVERLAP, ClosedFormScene


@dataclass(frozen=True)
class Stack(ClosedFormScene):
    """A stack of balls of equal radius, at rest on level ground.

    Attributes:
        masses: m_j from the lowest ball up [kg].
        friction: μ, or None for balls without rotation.
        overlap: initial depth of each contact [m]; 0 lets the balls fall into contact in the first step.
        radius: r [m].
        gravity: g [m/s²].

    Raises:
        ProblemError: if there is no ball, or the overlap is negative.
    """

    masses: Sequence[float] = (1.0, 1.0, 1.0, 1.0, 1.0)
    friction: float | None = None
    overlap: float = OVERLAP
    radius: float = 0.1
    gravity: float = 9.81

    def __post_init__(self) -> None:
        if not len(self.masses):
            raise ProblemError("a stack needs at least one ball.")
        if not 0.0 <= self.overlap < self.radius:
            raise ProblemError(f"overlap of a stack must be at least 0 and less than the radius, got {self.overlap}.")

    def system(self) -> BallSystem:
        """Return the balls on the ground z = 0."""
        effects: list[Effect] = [Gravity(self.gravity)]
        if self.friction is not None:
            effects.append(Friction(self.friction))
        masses = np.array(self.masses, dtype=np.float64)
        return ball_system(np.full(len(masses), self.radius), masses, [GROUND], effects)

    def supports(self) -> FloatArray:
        """Return the force of each contact, from the lowest up [N], shape (n,): the weight above it, g Σ_{j≥k} m_j."""
        weight: FloatArray = self.gravity * np.cumsum(np.array(self.masses, dtype=np.float64)[::-1])[::-1]
        return weight

    def exact(self, time: float) -> State:
        """Return the state at ``time`` [s]: the balls stay at rest."""
        system = self.system()
        centres = np.zeros((system.n_balls, 3))
        centres[:, 2] = self.radius - self.overlap + np.arange(system.n_balls) * (2.0 * self.radius - self.overlap)
        return State(time, centres.ravel(), system.without_spin(np.zeros((system.n_balls, 3))))


@dataclass(frozen=True)
class VGroove(RollingSphere):
    """A homogeneous sphere released from rest in a straight groove of two walls, which may descend along x.

    Attributes:
        half_angle: α between each wall and the plane of symmetry [rad].
        friction: μ, or None for a ball without rotation.
        slope: θ of the groove [rad].
        radius: r [m].
        mass: m [kg].
        gravity: g [m/s²].

    Raises:
        ProblemError: if α is outside (0, π/2), or θ outside [0, π/2).
    """

    half_angle: float = 0.6
    friction: float | None = 0.3
    slope: float = 0.3
    radius: float = 0.1
    mass: float = 1.0
    gravity: float = 9.81

    def __post_init__(self) -> None:
        if not 0.0 < self.half_angle < 0.5 * np.pi:
            raise ProblemError(f"half_angle of a groove must be between 0 and π/2, got {self.half_angle}.")
        if not 0.0 <= self.slope < 0.5 * np.pi:
            raise ProblemError(f"slope of a groove must be at least 0 and less than π/2, got {self.slope}.")

    @property
    def lever(self) -> float:
        """The sine of α; see ``RollingSphere``."""
        return sin(self.half_angle)

    def system(self) -> BallSystem:
        """Return the sphere between the walls, which meet in a line through the origin."""
        walls = []
        for side in (-1.0, 1.0):
            up = sin(self.half_angle)
            normal = (up * sin(self.slope), side * cos(self.half_angle), up * cos(self.slope))
            walls.append(Plane((0.0, 0.0, 0.0), normal))
        effects: list[Effect] = [Gravity(self.gravity)]
        if self.friction is not None:
            effects.append(Friction(self.friction))
        return ball_system(np.array([self.radius]), np.array([self.mass]), walls, effects)

    @property
    def wall_force(self) -> float:
        """Normal force of each wall [N], m g cos θ / (2 sin α).

        If friction sticks, it may also carry weight across the groove, and the normal force is not unique.
        """
        return self.mass * self.gravity * cos(self.slope) / (2.0 * sin(self.half_angle))

    def exact(self, time: float) -> State:
        """Return the state at ``time`` [s]: both accelerations are constant."""
        height = (self.radius - OVERLAP) / self.lever
        centre = height * self.upward + 0.5 * self.acceleration * time**2 * self.downhill
        velocity = time * self.acceleration * self.downhill
        if self.friction is not None:
            velocity = np.concatenate([velocity, [0.0, time * self.spin_acceleration, 0.0]])
        return State(time, centre, velocity)
