"""A sphere and a block on an inclined or level plane, which roll, slide, or come to rest by Coulomb friction."""

from dataclasses import dataclass
from math import cos, inf, sin, tan

import numpy as np

from ...arrays import FloatArray
from ...errors import ProblemError
from ..bodies.balls import SPHERE_INERTIA, BallSystem
from ..bodies.surfaces import Plane
from ..bodies.system import MechanicalSystem
from ..state import State
from .effects import Friction, Gravity, ball_system
from .scene import GROUND, OVERLAP, ClosedFormScene, check_positive


class RollingSphere(ClosedFormScene):
    """A homogeneous sphere that descends from rest on a plane or in a groove.

    The normals of the walls make the angle α with their plane of symmetry. The points of contact are at the distance
    r sin α from the axis of rotation; on a plane sin α = 1.
    """

    slope: float
    friction: float | None
    radius: float
    gravity: float

    @property
    def lever(self) -> float:
        """Distance of the points of contact from the axis of rotation relative to the radius, sin α."""
        return 1.0

    @property
    def upward(self) -> FloatArray:
        """Unit normal to the direction of descent in the plane of symmetry, shape (3,)."""
        return np.array([sin(self.slope), 0.0, cos(self.slope)])

    @property
    def downhill(self) -> FloatArray:
        """Unit direction of descent, shape (3,)."""
        return np.array([cos(self.slope), 0.0, -sin(self.slope)])

    @property
    def rolls(self) -> bool:
        """Whether the sphere has friction and rolls without slip: tan θ ≤ μ (5 sin²α + 2)/(2 sin α), on a plane 7μ/2.

        Rolling requires the friction force m g sin θ κ/(1 + κ) with κ = 2/(5 sin²α), on a plane 2/7 m g sin θ.
        Each of two walls has the normal force m g cos θ/(2 sin α), so friction is at most μ m g cos θ/sin α. For tan θ
        above the bound, up to sin α/√(sin²α − μ² cos²α) times it, a ball wedged by friction across a groove can also
        roll; the motion from rest is not unique there.
        """
        if self.friction is None:
            return False
        return tan(self.slope) <= self.friction * (5.0 * self.lever**2 + 2.0) / (2.0 * self.lever)

    @property
    def acceleration(self) -> float:
        """Acceleration of the centre [m/s²]: g sin θ/(1 + κ) rolling, g (sin θ − μ cos θ/sin α) sliding."""
        if self.rolls:
            return self.gravity * sin(self.slope) / (1.0 + SPHERE_INERTIA / self.lever**2)
        return self.gravity * (sin(self.slope) - (self.friction or 0.0) * cos(self.slope) / self.lever)

    @property
    def spin_acceleration(self) -> float:
        """Angular acceleration about the horizontal axis normal to the descent [rad/s²].

        It is a/(r sin α) rolling, and 5/2 μ g cos θ / r sliding, where all friction acts at the lever r sin α.
        """
        if self.rolls:
            return self.acceleration / (self.radius * self.lever)
        return (self.friction or 0.0) * self.gravity * cos(self.slope) / (SPHERE_INERTIA * self.radius)


@dataclass(frozen=True)
class SphereOnIncline(RollingSphere):
    """A homogeneous sphere released from rest at the origin of an incline that descends along x.

    Attributes:
        slope: θ [rad].
        friction: μ.
        radius: r [m].
        mass: m [kg].
        gravity: g [m/s²].

    Raises:
        ProblemError: if θ is outside (0, π/2).
    """

    slope: float = 0.3
    friction: float = 0.5
    radius: float = 0.1
    mass: float = 1.0
    gravity: float = 9.81

    def __post_init__(self) -> None:
        if not 0.0 < self.slope < 0.5 * np.pi:
            raise ProblemError(f"slope of an incline must be between 0 and π/2, got {self.slope}.")

    def system(self) -> BallSystem:
        """Return the sphere on the incline."""
        plane = Plane((0.0, 0.0, 0.0), (sin(self.slope), 0.0, cos(self.slope)))
        effects = (Gravity(self.gravity), Friction(self.friction))
        return ball_system(np.array([self.radius]), np.array([self.mass]), [plane], effects)

    def exact(self, time: float) -> State:
        """Return the state at ``time`` [s]: both accelerations are constant."""
        centre = (self.radius - OVERLAP) * self.upward + 0.5 * self.acceleration * time**2 * self.downhill
        axis = np.cross(self.upward, self.downhill)
        velocity = time * np.concatenate([self.acceleration * self.downhill, self.spin_acceleration * axis])
        return State(time, centre, velocity)


@dataclass(frozen=True)
class BlockOnIncline(ClosedFormScene):
    """A block, q = (x, z) along and normal to an incline that descends along x; it cannot tip.

    Attributes:
        slope: θ [rad].
        friction: μ.
        speed: initial velocity downhill [m/s]; negative for a block that is pushed up.
        mass: m [kg].
        gravity: g [m/s²].

    Raises:
        ProblemError: if θ is outside [0, π/2).
    """

    slope: float = 0.3
    friction: float = 0.5
    speed: float = 1.0
    mass: float = 1.0
    gravity: float = 9.81

    def __post_init__(self) -> None:
        if not 0.0 <= self.slope < 0.5 * np.pi:
            raise ProblemError(f"slope of an incline must be at least 0 and less than π/2, got {self.slope}.")

    def system(self) -> MechanicalSystem:
        """Return the block with one planar contact, the gap z."""
        mass = self.mass * np.eye(2)
        weight = self.mass * self.gravity * np.array([sin(self.slope), -cos(self.slope)])
        directions = np.array([[0.0, 1.0], [1.0, 0.0]])
        return MechanicalSystem(
            mass=lambda position: mass,
            force=lambda position, velocity: weight,
            gap=lambda position: position[1:],
            directions=lambda position: directions,
            friction=[self.friction],
            restitution_normal=[0.0],
            restitution_tangential=[0.0],
        )

    def potential_energy(self, position: FloatArray) -> float:
        """Return the potential energy of the weight at q [J], shape (2,); 0 at the origin."""
        return self.mass * self.gravity * float(cos(self.slope) * position[1] - sin(self.slope) * position[0])

    @property
    def holds(self) -> bool:
        """Whether a block at rest stays at rest: tan θ ≤ μ."""
        return tan(self.slope) <= self.friction

    def acceleration(self, direction: float) -> float:
        """Return the acceleration of sliding downhill (+1) or uphill (−1) [m/s²], g (sin θ ∓ μ cos θ)."""
        return self.gravity * (sin(self.slope) - direction * self.friction * cos(self.slope))

    @property
    def stop_time(self) -> float:
        """Time at which the initial motion stops [s], |v_0| / (g (μ cos θ ∓ sin θ)); inf if it never does."""
        if self.speed == 0.0:
            return 0.0
        deceleration = -np.sign(self.speed) * self.acceleration(float(np.sign(self.speed)))
        return abs(self.speed) / deceleration if deceleration > 0.0 else inf

    def exact(self, time: float) -> State:
        """Return the state at ``time`` [s]: the block slides to a stop, then stays or slides down."""
        before_stop = min(time, self.stop_time)
        rate = self.acceleration(float(np.sign(self.speed)))
        x, velocity = self.speed * before_stop + 0.5 * rate * before_stop**2, self.speed + rate * before_stop
        if time >= self.stop_time:
            after_stop, rate = time - before_stop, 0.0 if self.holds else self.acceleration(1.0)
            x, velocity = x + 0.5 * rate * after_stop**2, rate * after_stop
        return State(time, np.array([x, -OVERLAP]), np.array([velocity, 0.0]))


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
        """Time at which rolling begins [s], 2 v_0/(7 μ g).

        Friction reduces v at the rate μ g and increases r ω at the rate 5/2 μ g until they are equal.
        """
        return 2.0 * self.speed / (7.0 * self.friction * self.gravity)

    @property
    def rolling_speed(self) -> float:
        """Speed of rolling [m/s], 5/7 v_0, by conservation of angular momentum about the point of contact."""
        return self.speed / (1.0 + SPHERE_INERTIA)

    def exact(self, time: float) -> State:
        """Return the state at ``time`` [s]: uniform deceleration while the sphere slides, then uniform motion."""
        sliding = min(time, self.rolling_time)
        deceleration = self.friction * self.gravity
        x = self.speed * sliding - 0.5 * deceleration * sliding**2 + self.rolling_speed * (time - sliding)
        spin = deceleration * sliding / (SPHERE_INERTIA * self.radius)
        velocity = np.array([self.speed - deceleration * sliding, 0.0, 0.0, 0.0, spin, 0.0])
        return State(time, np.array([x, 0.0, self.radius - OVERLAP]), velocity)
