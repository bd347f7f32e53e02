"""Impacts: a ball that hits a plane obliquely, and Newton's cradle with simultaneous impacts."""

from dataclasses import dataclass

import numpy as np

from ...errors import ProblemError
from ..bodies.balls import SPHERE_INERTIA, BallSystem
from ..state import State
from .effects import Friction, Restitution, ball_system
from .scene import GROUND, OVERLAP, ClosedFormScene, check_positive


@dataclass(frozen=True)
class ObliqueImpact(ClosedFormScene):
    """A homogeneous sphere without spin that hits level ground obliquely, without gravity and with ε_T = 0.

    Attributes:
        normal_speed: |v_N|, the speed towards the ground [m/s].
        tangential_speed: v_T along x [m/s].
        friction: μ.
        restitution: ε_N.
        distance: initial distance of the lowest point of the sphere from the ground [m].
        radius: r [m].
        mass: m [kg].

    Raises:
        ProblemError: if the normal speed or the distance is not positive.
    """

    normal_speed: float = 1.0
    tangential_speed: float = 0.5
    friction: float = 0.2
    restitution: float = 0.5
    distance: float = 0.1
    radius: float = 0.1
    mass: float = 1.0

    def __post_init__(self) -> None:
        check_positive(self, "an oblique impact", "normal_speed", "distance")

    def system(self) -> BallSystem:
        """Return the sphere above the ground z = 0."""
        effects = (Friction(self.friction), Restitution(self.restitution, 0.0))
        return ball_system(np.array([self.radius]), np.array([self.mass]), [GROUND], effects)

    @property
    def impact_time(self) -> float:
        """Time at which the sphere hits the ground [s]."""
        return self.distance / self.normal_speed

    @property
    def sticks(self) -> bool:
        """Whether the point of contact sticks: |v_T| ≤ 7/2 μ (1 + ε_N) |v_N|.

        The impulse 2/7 m v_T that stops the point of contact must not exceed μ Λ_N = μ (1 + ε_N) m |v_N|.
        """
        available = self.friction * (1.0 + self.restitution) * self.normal_speed
        return abs(self.tangential_speed) <= 3.5 * available

    @property
    def tangential_speed_after(self) -> float:
        """v_T after the impact [m/s]: 5/7 v_T if the contact sticks; otherwise |v_T| falls by μ (1 + ε_N) |v_N|."""
        if self.sticks:
            return self.tangential_speed / (1.0 + SPHERE_INERTIA)
        loss = self.friction * (1.0 + self.restitution) * self.normal_speed
        return self.tangential_speed - float(np.sign(self.tangential_speed)) * loss

    def exact(self, time: float) -> State:
        """Return the state at ``time`` [s]: uniform motion before and after the impact."""
        before, after = min(time, self.impact_time), max(time - self.impact_time, 0.0)
        v_x, v_z, spin = self.tangential_speed, -self.normal_speed, 0.0
        x, z = v_x * before, self.distance + v_z * before
        if time >= self.impact_time:
            v_x, v_z = self.tangential_speed_after, self.restitution * self.normal_speed
            spin = (self.tangential_speed - v_x) / (SPHERE_INERTIA * self.radius)
            x, z = x + v_x * after, z + v_z * after
        return State(time, np.array([x, 0.0, z + self.radius]), np.array([v_x, 0.0, v_z, 0.0, spin, 0.0]))


@dataclass(frozen=True)
class NewtonsCradle(ClosedFormScene):
    """A row of equal touching balls along x, which another ball strikes; all impulses act in one coupled impact.

    Attributes:
        n_balls: n, including the striking ball.
        restitution: e of every contact.
        speed: v of the striking ball [m/s].
        distance: initial distance between the striking ball and the next one [m].
        radius: r [m].
        mass: m of each ball [kg].

    Raises:
        ProblemError: if there are fewer than two balls, or the speed or the distance is not positive.
    """

    n_balls: int = 5
    restitution: float = 0.4
    speed: float = 1.0
    distance: float = 0.05
    radius: float = 0.1
    mass: float = 1.0

    def __post_init__(self) -> None:
        if self.n_balls < 2:
            raise ProblemError(f"n_balls of a cradle must be at least 2, got {self.n_balls}.")
        check_positive(self, "a cradle", "speed", "distance")

    def system(self) -> BallSystem:
        """Return the balls, without gravity, friction or ground."""
        n = self.n_balls
        return ball_system(np.full(n, self.radius), np.full(n, self.mass), [], [Restitution(self.restitution)])

    @property
    def impact_time(self) -> float:
        """Time at which the first ball strikes [s]."""
        return self.distance / self.speed

    @property
    def velocities_after(self) -> tuple[float, float]:
        """Velocity of the first ball along x, v ((1 + e)/n − e), and of all others, v (1 + e)/n [m/s].

        By Newton's impact law, the relative velocity after the impact is zero between balls that touched at rest, and
        e v between the first two. Momentum is conserved.
        """
        others = self.speed * (1.0 + self.restitution) / self.n_balls
        return others - self.restitution * self.speed, others

    def exact(self, time: float) -> State:
        """Return the state at ``time`` [s]: uniform motion before and after the impact."""
        before, after = min(time, self.impact_time), max(time - self.impact_time, 0.0)
        centres, velocities = np.zeros((self.n_balls, 3)), np.zeros((self.n_balls, 3))
        centres[:, 0] = np.arange(self.n_balls) * (2.0 * self.radius - OVERLAP)
        centres[0, 0] = self.speed * before - self.distance - OVERLAP
        velocities[0, 0] = self.speed
        if time >= self.impact_time:
            velocities[0, 0], velocities[1:, 0] = self.velocities_after
            centres += velocities * after
        return State(time, centres.ravel(), velocities.ravel())
