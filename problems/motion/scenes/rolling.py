"""A sphere thrown along level ground, which slides at first and then rolls."""

from dataclasses import dataclass

import numpy as np

from ..bodies.balls import SPHERE_INERTIA, BallSystem
from ..state import State
from .effects import Friction, Gravity, ball_system
from .scene import GROUND, OVERLAP, ClosedFormScene, check_positive


@dataclass(frozen=True)
class SlidingSphere(ClosedFormScene):
    """A homogeneous sphere that touches the ground at the origin and starts to slide along x without spin.

    Attributes:
        speed: v_0 [m/s].
        friction: μ.
        radius: r [m].
        mass: m [kg].
        gravity: g [m/s²].

    Raises:
        ProblemError: if the speed, μ or gravity is not positive.
    """

    speed: float = 1.0
    friction: float = 0.3
    radius: float = 0.1
    mass: float = 1.0
    gravity: float = 9.81

    def __post_init__(self) -> None:
        check_positive(self, "a sliding sphere", "speed", "friction", "gravity")

    def system(self) -> BallSystem:
        """Return the sphere on the ground z = 0."""
        effects = (Gravity(self.gravity), Friction(self.friction))
        return ball_system(np.array([self.radius]), np.array([self.mass]), [GROUND], effects)

    @property
    def rolling_time(self) -> float:
        """When it begins to roll [s], 2 v_0/(7 μ g).

        Friction lowers v at μ g and raises r ω at 5/2 μ g until they meet.
        """
        return 2.0 * self.speed / (7.0 * self.friction * self.gravity)

    @property
    def rolling_speed(self) -> float:
        """Speed of rolling [m/s], 5/7 v_0, by the angular momentum about the point of contact."""
        return self.speed / (1.0 + SPHERE_INERTIA)

    def exact(self, time: float) -> State:
        """Return the state at ``time`` [s]: uniformly slowed while it slides, uniform when it rolls."""
        sliding = min(time, self.rolling_time)
        slowing = self.friction * self.gravity
        x = self.speed * sliding - 0.5 * slowing * sliding**2 + self.rolling_speed * (time - sliding)
        spin = slowing * sliding / (SPHERE_INERTIA * self.radius)
        velocity = np.array([self.speed - slowing * sliding, 0.0, 0.0, 0.0, spin, 0.0])
        return State(time, np.array([x, 0.0, self.radius - OVERLAP]), velocity)
