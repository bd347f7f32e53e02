"""Scenes of rods connected by joints, which move in the plane y = 0: a pendulum, chains, and a four-bar linkage.

Angles are rotations about the y axis. In the pendulum and the chains, a rod of angle 0 hangs down from its upper joint.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import acos, atan2, cos, hypot, inf, sin, sqrt
from typing import ClassVar

import numpy as np
import scipy  # imports its subpackages at their first use

from ....arrays import FloatArray
from ....errors import ProblemError
from ...bodies.rigid.joints import WORLD, Joint, RigidJoints
from ...bodies.rigid.orientation import Y_AXIS, about
from ...bodies.rigid.rigid_bodies import RigidBodies
from ...bodies.rigid.round_shapes import Sphere
from ...bodies.rigid.shapes import Box, Shape
from ...state import State
from ..effects import Gravity
from ..scene import ClosedFormScene, Observable, check_positive
from .effects import rigid_bodies

SLENDERNESS = 0.05
"""Thickness of a rod divided by its length."""

DEPTH = 1e-6
"""Penetration [m] that remains when positions are projected onto joint limits; joints are closed to rounding."""


def rod(length: float) -> Box:
    """Return the shape of a rod of ``length`` [m] along its z axis."""
    return Box((SLENDERNESS * length, SLENDERNESS * length, length))


def rod_direction(angle: float) -> FloatArray:
    """Return the unit vector from the upper to the lower end of a rod at ``angle`` [rad], shape (3,)."""
    return np.array([-sin(angle), 0.0, -cos(angle)])


def jointed_bodies(
    shapes: Sequence[Shape], masses: FloatArray, joints: Sequence[Joint], gravity: float, restitution: float = 1.0
) -> RigidBodies:
    """Return bodies of ``masses`` [kg], shape (n,), connected by joints with ``restitution``, under gravity [m/s²]."""
    system = rigid_bodies(shapes, masses, [], [Gravity(gravity)] if gravity else [])
    return replace(system, joints=RigidJoints(joints, len(shapes), restitution))


def joint_opening(system: RigidBodies) -> Observable:
    """Return the observable of the largest residual of the joints of a system [m or rad]."""
    joints = system.joints
    assert joints is not None
    return Observable(
        "opening",
        lambda state: float(np.abs(joints.errors_at(system.poses(state.position)).residual).max()),
        label="opening of joints [m or rad]",
        head="opening",
    )


def swing_modes(
    lengths: FloatArray, offsets: FloatArray, masses: FloatArray, moments: FloatArray, gravity: float
) -> tuple[FloatArray, FloatArray]:
    """Return the modes of small oscillations of a hanging chain of n bodies in its plane.

    Let the lever a_ki be the length of body i for i < k, the offset of body i for i = k, and 0 for i > k. The kinetic
    energy is ½ Σ (Σ_k m_k a_ki a_kj + J_i δ_ij) θ̇_i θ̇_j, and the potential energy ½ Σ g m_k a_ki θ_i².

    Args:
        lengths: distances from the upper to the lower joint of each body [m], shape (n,).
        offsets: distances from the upper joint to the centre of each body [m], shape (n,).
        masses: m [kg], shape (n,).
        moments: moments of inertia J about axes through the centres, normal to the plane [kg m²], shape (n,).
        gravity: g [m/s²].

    Returns:
        Ascending angular frequencies [rad/s], shape (n,), and angles with one column per mode, shape (n, n).
    """
    levers = np.tril(np.tile(lengths, (len(masses), 1)), -1) + np.diag(offsets)
    inertia = levers.T @ (masses[:, None] * levers) + np.diag(moments)
    squared, modes = scipy.linalg.eigh(gravity * np.diag(levers.T @ masses), inertia)
    return np.sqrt(squared), modes


@dataclass(frozen=True)
class Pendulum(ClosedFormScene):
    """A rod on a revolute joint at its upper end, released at rest.

    The motion is sin(θ/2) = k cd(ω₀ t, k), with Jacobi's function cd, k = sin(θ₀/2), ω₀² = m g (L/2) / (J + m L²/4) and
    the moment of inertia J about the centre.

    Attributes:
        angle: θ₀ [rad].
        length: L [m].
        mass: m [kg].
        gravity: g [m/s²].

    Raises:
        ProblemError: if the angle is not between −π and π, or another attribute is not positive.
    """

    angle: float = 1.0
    length: float = 1.0
    mass: float = 1.0
    gravity: float = 9.81

    depth: ClassVar[float] = DEPTH

    def __post_init__(self) -> None:
        check_positive(self, "a pendulum", "length", "mass", "gravity")
        if not -np.pi < self.angle < np.pi:
            raise ProblemError(f"angle of a pendulum must be between -π and π, got {self.angle}.")

    @property
    def frequency(self) -> float:
        """Angular frequency ω₀ of small oscillations [rad/s]."""
        half, moment = 0.5 * self.length, rod(self.length).inertia[1] / rod(self.length).volume
        return sqrt(self.gravity * half / (moment + half * half))

    @property
    def period(self) -> float:
        """Period [s], 4 K(k) / ω₀."""
        return 4.0 * float(scipy.special.ellipk(sin(0.5 * self.angle) ** 2)) / self.frequency

    def system(self, friction: float = 0.0) -> RigidBodies:
        """Return the rod; ``friction`` is the largest moment of friction in its joint [N m]."""
        joint = Joint("revolute", 0, WORLD, (0.0, 0.0, 0.5 * self.length), axis=Y_AXIS, friction=friction)
        return jointed_bodies([rod(self.length)], np.array([self.mass]), [joint], self.gravity)

    def exact(self, time: float) -> State:
        """Return the state at ``time`` [s]."""
        k = sin(0.5 * self.angle)
        sn, cn, dn, _ = scipy.special.ellipj(self.frequency * time, k * k)
        angle = 2.0 * np.arcsin(k * cn / dn)
        rate = -2.0 * k * self.frequency * sqrt(1.0 - k * k) * sn / dn
        half = 0.5 * self.length
        velocity = half * rate * np.array([-cos(angle), 0.0, sin(angle)])
        position = np.concatenate([half * rod_direction(angle), about(Y_AXIS, angle)])
        return State(time, position, np.concatenate([velocity, [0.0, rate, 0.0]]))

    def angle_of(self, state: State) -> float:
        """Return θ of a state [rad]."""
        return 2.0 * float(np.arctan2(state.position[5], state.position[3]))

    @property
    def observables(self) -> Sequence[Observable]:
        """The angle, and the opening of the joint."""
        return (Observable("angle", self.angle_of, label="angle [rad]", head="angle"), joint_opening(self.system()))


@dataclass(frozen=True)
class Chain:
    """A hanging chain of equal rods on ball joints, released at rest with equal angles.

    Attributes:
        n_links: number of rods.
        angle: initial angle of all rods [rad].
        length: length of a rod [m].
        mass: mass of a rod [kg].
        gravity: g [m/s²].

    Raises:
        ProblemError: if there is no rod, or a number is not positive.
    """

    n_links: int = 5
    angle: float = 0.5
    length: float = 0.2
    mass: float = 1.0
    gravity: float = 9.81

    depth: ClassVar[float] = DEPTH

    def __post_init__(self) -> None:
        check_positive(self, "a chain", "n_links", "length", "mass", "gravity")

    @property
    def joints(self) -> list[Joint]:
        """The joints from the top down."""
        top, bottom = (0.0, 0.0, 0.5 * self.length), (0.0, 0.0, -0.5 * self.length)
        lower = [Joint("ball", link, link - 1, top, bottom) for link in range(1, self.n_links)]
        return [Joint("ball", 0, WORLD, top), *lower]

    def system(self) -> RigidBodies:
        """Return the rods."""
        rods, masses = [rod(self.length)] * self.n_links, np.full(self.n_links, self.mass)
        return jointed_bodies(rods, masses, self.joints, self.gravity)

    def state(self, angles: FloatArray) -> State:
        """Return the state at rest with ``angles`` [rad], shape (n_links,)."""
        poses, end = [], np.zeros(3)
        for angle in angles.tolist():
            poses.append([*(end + 0.5 * self.length * rod_direction(angle)), *about(Y_AXIS, angle)])
            end = end + self.length * rod_direction(angle)
        return State(0.0, np.array(poses).ravel(), np.zeros(6 * self.n_links))

    def start(self) -> State:
        """Return the state at time 0."""
        return self.state(np.full(self.n_links, self.angle))

    def normal_modes(self) -> tuple[FloatArray, FloatArray]:
        """Return the modes of small oscillations in the plane; see ``swing_modes``."""
        lengths, system = np.full(self.n_links, self.length), self.system()
        return swing_modes(lengths, 0.5 * lengths, system.masses, system.moments[:, 1], self.gravity)

    @property
    def observables(self) -> Sequence[Observable]:
        """The opening of the joints."""
        return (joint_opening(self.system()),)


@dataclass(frozen=True)
class BallOnChain:
    """A heavy ball at the lower end of a light chain, released at rest.

    Under the weight of the ball, rods oscillate with frequencies up to ω = ``highest_frequency``. The midpoint rule
    evaluates the directions of joints at an explicit midpoint, so that it diverges with steps longer than 2/ω.

    Attributes:
        n_links: number of rods.
        ratio: mass of the ball divided by that of a rod.
        angle: initial angle of the chain [rad].
        length: length of a rod [m].
        radius: radius of the ball [m].
        mass: mass of a rod [kg].
        gravity: g [m/s²].

    Raises:
        ProblemError: if there is no rod, or a number is not positive.
    """

    n_links: int = 5
    ratio: float = 1e4
    angle: float = 0.3
    length: float = 0.2
    radius: float = 0.1
    mass: float = 1.0
    gravity: float = 9.81

    depth: ClassVar[float] = DEPTH

    def __post_init__(self) -> None:
        check_positive(self, "a ball on a chain", "n_links", "ratio", "length", "radius", "mass", "gravity")

    @property
    def chain(self) -> Chain:
        """The chain without its ball."""
        return Chain(self.n_links, self.angle, self.length, self.mass, self.gravity)

    def system(self) -> RigidBodies:
        """Return the rods, then the ball."""
        hook = Joint("ball", self.n_links, self.n_links - 1, (0.0, 0.0, self.radius), (0.0, 0.0, -0.5 * self.length))
        shapes: list[Shape] = [*[rod(self.length)] * self.n_links, Sphere(self.radius)]
        masses = np.append(np.full(self.n_links, self.mass), self.ratio * self.mass)
        return jointed_bodies(shapes, masses, [*self.chain.joints, hook], self.gravity)

    @property
    def highest_frequency(self) -> float:
        """Highest angular frequency of small oscillations [rad/s], that of rods transverse to the pull of the ball."""
        lengths, system = np.full(self.n_links + 1, self.length), self.system()
        offsets = np.append(0.5 * lengths[:-1], self.radius)
        return float(swing_modes(lengths, offsets, system.masses, system.moments[:, 1], self.gravity)[0][-1])

    @property
    def step_size(self) -> float:
        """Δt [s], half the step above which the midpoint rule diverges, to two digits; at most a millisecond."""
        return min(1e-3, float(f"{1.0 / self.highest_frequency:.2g}"))

    @property
    def observables(self) -> Sequence[Observable]:
        """The opening of the joints."""
        return (joint_opening(self.system()),)

    def start(self) -> State:
        """Return the state at time 0."""
        rods = self.chain.start().position
        centre = (self.n_links * self.length + self.radius) * rod_direction(self.angle)
        position = np.concatenate([rods, centre, about(Y_AXIS, self.angle)])
        return State(0.0, position, np.zeros(6 * (self.n_links + 1)))


@dataclass(frozen=True)
class FourBar(ClosedFormScene):
    """A linkage of crank, coupler and rocker on revolute joints, without gravity, with a given initial speed.

    The kinetic energy ½ I(θ) θ̇² is constant, which gives θ̇ = θ̇₀ (I(θ₀)/I(θ))^½ for the angle θ of the crank. The
    ground joints are at (0, 0) and (base, 0) in the plane. The four joints impose 20 constraints on 18 velocities, but
    leave one degree of freedom, because three constraints are redundant.

    Attributes:
        crank: length of the crank [m].
        coupler: length of the coupler [m].
        rocker: length of the rocker [m].
        base: distance between the ground joints [m].
        angle: initial angle between crank and base [rad].
        speed: initial angular velocity of the crank [rad/s].
        density: mass per length [kg/m].

    Raises:
        ProblemError: if the crank cannot make full turns, or a number is not positive or not finite.
    """

    crank: float = 0.3
    coupler: float = 0.9
    rocker: float = 0.7
    base: float = 0.8
    angle: float = 0.5
    speed: float = 3.0
    density: float = 1.0

    depth: ClassVar[float] = DEPTH

    def __post_init__(self) -> None:
        check_positive(self, "a four-bar linkage", "crank", "coupler", "rocker", "base", "density")
        farthest, nearest = self.base + self.crank, abs(self.base - self.crank)
        if farthest >= self.coupler + self.rocker or nearest <= abs(self.coupler - self.rocker):
            raise ProblemError(
                "the crank cannot turn fully; shorten it, or choose coupler and rocker by Grashof's law."
            )
        if not -inf < self.speed < inf:
            raise ProblemError(f"speed of a four-bar linkage must be finite, got {self.speed}.")

    @property
    def lengths(self) -> tuple[float, float, float]:
        """Lengths of crank, coupler and rocker [m]."""
        return self.crank, self.coupler, self.rocker

    def angles(self, crank: float) -> FloatArray:
        """Return the angles of crank, coupler and rocker from the base [rad], shape (3,), by the law of cosines.

        The first angle is ``crank``. The coupler points towards the rocker, and the rocker away from its ground joint.
        """
        x, z = self.base - self.crank * cos(crank), -self.crank * sin(crank)
        distance = hypot(x, z)
        inner = acos((self.coupler**2 + distance**2 - self.rocker**2) / (2.0 * self.coupler * distance))
        coupler = atan2(z, x) + inner
        end = np.array([cos(coupler), sin(coupler)]) * self.coupler - [x, z]
        return np.array([crank, coupler, atan2(end[1], end[0])])

    def rates(self, angles: FloatArray, speed: float) -> FloatArray:
        """Return the angular velocities of the rods [rad/s], shape (3,), from the angles and the crank's ``speed``."""
        a, b, c = angles.tolist()
        coupler = speed * self.crank * sin(c - a) / (self.coupler * sin(b - c))
        rocker = speed * self.crank * sin(b - a) / (self.rocker * sin(b - c))
        return np.array([speed, coupler, rocker])

    def system(self) -> RigidBodies:
        """Return crank, coupler and rocker, which are rods along their x axes."""
        a, b, c = (0.5 * length for length in self.lengths)
        joints = [
            Joint("revolute", 0, WORLD, (-a, 0.0, 0.0), axis=Y_AXIS),
            Joint("revolute", 1, 0, (-b, 0.0, 0.0), (a, 0.0, 0.0), Y_AXIS),
            Joint("revolute", 2, 1, (c, 0.0, 0.0), (b, 0.0, 0.0), Y_AXIS),
            Joint("revolute", 2, WORLD, (-c, 0.0, 0.0), (self.base, 0.0, 0.0), Y_AXIS),
        ]
        shapes = [Box((length, SLENDERNESS * length, SLENDERNESS * length)) for length in self.lengths]
        return jointed_bodies(shapes, self.density * np.array(self.lengths), joints, 0.0)

    def state(self, crank: float, speed: float) -> State:
        """Return the state at time 0 from the angle [rad] and the angular velocity ``speed`` [rad/s] of the crank."""
        angles = self.angles(crank)
        along = np.column_stack([np.cos(angles), np.zeros(3), np.sin(angles)]) * np.array(self.lengths)[:, None]
        rates = self.rates(angles, speed)[:, None]
        across = np.column_stack([-along[:, 2], np.zeros(3), along[:, 0]]) * rates
        base = np.array([self.base, 0.0, 0.0])
        centres = np.array([0.5 * along[0], along[0] + 0.5 * along[1], base + 0.5 * along[2]])
        velocities = np.array([0.5 * across[0], across[0] + 0.5 * across[1], 0.5 * across[2]])
        orientations = np.array([about(Y_AXIS, -angle) for angle in angles.tolist()])
        angular_velocities = np.column_stack([np.zeros(3), -rates[:, 0], np.zeros(3)])
        return State(
            0.0, np.hstack([centres, orientations]).ravel(), np.hstack([velocities, angular_velocities]).ravel()
        )

    def exact(self, time: float) -> State:
        """Return the state at ``time`` [s], by integration of θ̇ with tolerances of 1e-12."""
        system = self.system()

        def energy(angle: float) -> float:
            """Return ½ I(θ)."""
            return system.kinetic_energy(self.state(angle, 1.0).velocity)

        energy_at_start = energy(self.angle)

        def speed(angle: float) -> float:
            return self.speed * sqrt(energy_at_start / energy(angle))

        if time == 0.0:
            return self.state(self.angle, self.speed)
        from scipy.integrate import solve_ivp  # import takes 0.2 s

        solution = solve_ivp(lambda _, q: [speed(q[0])], (0.0, time), [self.angle], "DOP853", rtol=1e-12, atol=1e-12)
        angle = float(solution.y[0, -1])
        return replace(self.state(angle, speed(angle)), time=time)

    @property
    def observables(self) -> Sequence[Observable]:
        """The opening of the joints."""
        return (joint_opening(self.system()),)
