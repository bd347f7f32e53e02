"""A ball that is dropped and bounces infinitely often in finite time (Zeno)."""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from ...errors import ProblemError
from ..bodies.balls import BallSystem
from ..state import State
from .effects import Gravity, Restitution, ball_system
from .scene import GROUND, ClosedFormScene, check_positive


@dataclass(frozen=True)
class BouncingBall(ClosedFormScene):
    """A ball dropped from rest onto level ground, without friction and therefore without rotation.

    Attributes:
        height: initial height h of the lowest point of the ball above the ground [m].
        restitution: e of the impacts, below 1.
        radius: r [m].
        mass: m [kg].
        gravity: g [m/s²].

    Raises:
        ProblemError: if a length, the mass or gravity is not positive, or e is outside [0, 1).
    """

    height: float = 1.0
    restitution: float = 0.5
    radius: float = 0.1
    mass: float = 1.0
    gravity: float = 9.81

    def __post_init__(self) -> None:
        check_positive(self, "a bouncing ball", "height", "radius", "mass", "gravity")
        if not 0.0 <= self.restitution < 1.0:
            raise ProblemError(f"restitution of a bouncing ball must be in [0, 1), got {self.restitution}.")

    def system(self) -> BallSystem:
        """Return the ball above the ground z = 0, with 3 degrees of freedom."""
        effects = (Gravity(self.gravity), Restitution(self.restitution))
        return ball_system(np.array([self.radius]), np.array([self.mass]), [GROUND], effects)

    def start(self) -> State:
        """Return the ball at rest above the ground."""
        return State(0.0, np.array([0.0, 0.0, self.radius + self.height]), np.zeros(3))

    @property
    def fall_time(self) -> float:
        """Time of the first impact [s], √(2h/g)."""
        return sqrt(2.0 * self.height / self.gravity)

    @property
    def rest_time(self) -> float:
        """Time at which the impacts accumulate and the ball comes to rest [s], √(2h/g) (1 + e)/(1 − e).

        It is the sum of the fall √(2h/g) and the flight times 2 eᵏ √(2h/g), k = 1, 2, ….
        """
        return self.fall_time * (1.0 + self.restitution) / (1.0 - self.restitution)

    def impact_time(self, impact: int) -> float:
        """Return the time of impact k = 0, 1, … [s], √(2h/g) (1 + 2 (e + … + eᵏ))."""
        e = self.restitution
        return self.fall_time * (1.0 + 2.0 * e * (1.0 - e**impact) / (1.0 - e))

    def exact(self, time: float) -> State:
        """Return the state at ``time`` [s]: after impact k the ball rises at eᵏ⁺¹ √(2gh), and finally it rests."""
        if time < self.fall_time:
            return self._state(time, self.height - 0.5 * self.gravity * time**2, -self.gravity * time)
        impact, speed = 0, self.restitution * self.gravity * self.fall_time
        while time < self.rest_time and self.impact_time(impact + 1) <= time and speed > 0.0:
            impact, speed = impact + 1, self.restitution * speed
        flight = time - self.impact_time(impact)
        if time >= self.rest_time or self.gravity * flight > 2.0 * speed:
            return self._state(time, 0.0, 0.0)
        return self._state(time, speed * flight - 0.5 * self.gravity * flight**2, speed - self.gravity * flight)

    def _state(self, time: float, height: float, velocity: float) -> State:
        return State(time, np.array([0.0, 0.0, self.radius + height]), np.array([0.0, 0.0, velocity]))
