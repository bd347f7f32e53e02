"""Scenes of boxes that slide or tip on an incline, are thrown, or rest in a stack."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import cos, hypot, inf, sin, tan

import numpy as np

from ....arrays import FloatArray
from ....errors import ProblemError
from ...bodies.rigid.orientation import Y_AXIS, Z_AXIS, about, product, rotation_matrices
from ...bodies.rigid.rigid_bodies import FixedBody, RigidBodies
from ...bodies.rigid.shapes import Box, HalfSpace
from ...state import State
from ..effects import Friction, Gravity
from ..inclines import BlockOnIncline
from ..scene import OVERLAP, RESTING_OVERLAP, ClosedFormScene, Observable, check_positive
from .effects import BodyEffect, rigid_bodies

Size = tuple[float, ...]
"""Edge lengths along the three body axes [m]."""


def incline(slope: float) -> FixedBody:
    """Return a fixed half-space whose surface contains the origin and descends along x at ``slope`` [rad]."""
    return FixedBody(HalfSpace(), orientation=tuple(about(Y_AXIS, slope)))


def incline_normal(slope: float) -> FloatArray:
    """Return the unit normal of an incline at ``slope`` [rad], shape (3,)."""
    return np.array([sin(slope), 0.0, cos(slope)])


def downhill_direction(slope: float) -> FloatArray:
    """Return the unit vector along which an incline at ``slope`` [rad] descends, shape (3,)."""
    return np.array([cos(slope), 0.0, -sin(slope)])


def upright_poses(centres: FloatArray) -> FloatArray:
    """Return poses, shape (n, 7), with ``centres`` [m], shape (n, 3), and body axes parallel to the world axes."""
    poses = np.zeros((len(centres), 7))
    poses[:, :3], poses[:, 3] = centres, 1.0
    return poses


def _check_box(size: Size, slope: float, overlap: float) -> None:
    """Raise ``ProblemError`` if a size [m], a slope [rad] or an initial penetration [m] is out of range."""
    Box(size)  # raises if an edge is not positive
    if not 0.0 <= overlap < size[2]:
        raise ProblemError(f"overlap must be at least 0 and less than the height of a box, got {overlap}.")
    if not 0.0 <= slope < 0.5 * np.pi:
        raise ProblemError(f"slope of an incline must be at least 0 and less than π/2, got {slope}.")


class SlidingBox(ClosedFormScene):
    """Base class of scenes in which a box on an incline slides, stops or stays, and does not tip.

    For the attributes, see ``BoxOnIncline``.
    """

    slope: float
    friction: float
    speed: float
    size: Size
    turn: float
    overlap: float
    mass: float
    gravity: float

    @cached_property
    def block(self) -> BlockOnIncline:
        """The motion of the box in coordinates along and normal to the incline."""
        return BlockOnIncline(self.slope, self.friction, self.speed, self.mass, self.gravity)

    @property
    def reach(self) -> float:
        """Distance from the centre of the base to its edge in the direction of motion [m]."""
        along, across = abs(cos(self.turn)), abs(sin(self.turn))
        length, width, _ = self.size
        return min(0.5 * edge / cosine for edge, cosine in ((length, along), (width, across)) if cosine > 0.0)

    def check(self) -> None:
        """Raise ``ProblemError`` if a number is out of range, or the box would tip.

        Friction acts at the base, h/2 below the centre of a box of height h. It is μ N while the box slides, and
        N tan θ while the box is at rest. Its moment shifts the resultant normal force N by μ h/2, or (h/2) tan θ,
        from the centre of the base. The box tips if the shifted point lies outside the base.
        """
        _check_box(self.size, self.slope, self.overlap)
        check_positive(self, "a box", "mass")
        friction_ratio = min(self.friction, tan(self.slope)) if self.speed == 0.0 else self.friction
        if 0.5 * friction_ratio * self.size[2] > self.reach:
            raise ProblemError(
                f"a box of size {self.size} tips if friction of {friction_ratio:.4g} times the normal force acts on "
                "its base; reduce its friction or its height, or simulate a tipping_box."
            )

    def system(self) -> RigidBodies:
        """Return the box on its incline."""
        effects = (Gravity(self.gravity), Friction(self.friction))
        return rigid_bodies([Box(self.size)], np.array([self.mass]), [incline(self.slope)], effects)

    def exact(self, time: float) -> State:
        """Return the state at ``time`` [s]: the box slides to a stop, then stays or slides down."""
        block = self.block.exact(time)
        downhill = downhill_direction(self.slope)
        centre = (0.5 * self.size[2] - self.overlap) * incline_normal(self.slope) + block.position[0] * downhill
        orientation = product(about(Y_AXIS, self.slope)[None], about(Z_AXIS, self.turn)[None])[0]
        velocity = np.concatenate([block.velocity[0] * downhill, np.zeros(3)])
        return State(time, np.concatenate([centre, orientation]), velocity)

    @property
    def observables(self) -> Sequence[Observable]:
        """The rise of the centre since the start, normal to the incline."""
        return (Observable("lift", self.lift, label="lift [m]", head="lift"),)

    def lift(self, state: State) -> float:
        """Return the rise of the centre since the start, normal to the incline [m]."""
        return float(state.position[:3] @ incline_normal(self.slope)) - 0.5 * self.size[2] + self.overlap


@dataclass(frozen=True)
class BoxOnIncline(SlidingBox):
    """A box on an incline that descends along x: it slides if tan θ > μ, and stops or stays otherwise.

    Attributes:
        slope: θ [rad].
        friction: μ.
        speed: initial velocity downhill [m/s]; negative for a box that is pushed up.
        size: edge lengths along the incline, across it and normal to it [m].
        turn: rotation about the normal [rad].
        overlap: initial penetration of the contacts [m].
        mass: m [kg].
        gravity: g [m/s²].

    Raises:
        ProblemError: if θ is outside [0, π/2), the overlap is outside [0, height), the size or the mass is not
            positive, or the box would tip.
    """

    slope: float = 0.5
    friction: float = 0.4
    speed: float = 0.0
    size: Size = (0.2, 0.2, 0.1)
    turn: float = 0.0
    overlap: float = RESTING_OVERLAP
    mass: float = 1.0
    gravity: float = 9.81

    def __post_init__(self) -> None:
        self.check()


@dataclass(frozen=True)
class ThrownBox(SlidingBox):
    """A box thrown along level ground, which slides to a stop with the acceleration −μ g and does not lift off.

    Attributes:
        speed: initial velocity along x [m/s].
        friction: μ.
        size: edge lengths along x, y and z before the rotation [m].
        turn: rotation about the vertical [rad].
        overlap: initial penetration of the contacts [m].
        mass: m [kg].
        gravity: g [m/s²].

    Raises:
        ProblemError: if the overlap is outside [0, height), the size or the mass is not positive, or the box would tip.
    """

    speed: float = 6.0
    friction: float = 0.5
    size: Size = (0.1, 0.1, 0.1)
    turn: float = 0.0
    overlap: float = RESTING_OVERLAP
    mass: float = 1.0
    gravity: float = 9.81

    slope = 0.0

    def __post_init__(self) -> None:
        self.check()


@dataclass(frozen=True)
class TippingBox:
    """A box at rest on an incline, which tips over its lower edge if width/height < tan θ, and stays at rest otherwise.

    Attributes:
        slope: θ [rad].
        friction: μ.
        size: edge lengths along the incline (width), across it, and normal to it (height) [m].
        mass: m [kg].
        gravity: g [m/s²].

    Raises:
        ProblemError: if θ is outside [0, π/2), the size or the mass is not positive, or the lower edge would slide.
    """

    slope: float = 0.5
    friction: float = 0.8
    size: Size = (0.1, 0.1, 0.25)
    mass: float = 1.0
    gravity: float = 9.81

    def __post_init__(self) -> None:
        _check_box(self.size, self.slope, OVERLAP)
        check_positive(self, "a box", "mass")
        if self.holding_friction > self.friction:
            raise ProblemError(
                f"friction of a tipping box must be at least {self.holding_friction:.4g} to hold its lower edge, got "
                f"{self.friction}; increase it, or simulate a box_on_incline."
            )

    @property
    def arm(self) -> float:
        """Distance R of the centre from the lower edge [m], half the diagonal of the side face."""
        return 0.5 * hypot(self.size[0], self.size[2])

    @property
    def lean(self) -> float:
        """Angle [rad] from the vertical to the line from the lower edge to the centre, positive if the box tips."""
        return self.slope - float(np.arctan2(self.size[0], self.size[2]))

    @property
    def tips(self) -> bool:
        """Whether the box tips: width/height < tan θ."""
        return self.size[0] < self.size[2] * tan(self.slope)

    @property
    def angular_acceleration(self) -> float:
        """Initial angular acceleration [rad/s²], m g R sin(lean)/J with J = 4/3 m R² about the edge; 0 if it stays."""
        return 0.75 * self.gravity / self.arm * sin(self.lean) if self.tips else 0.0

    @property
    def holding_friction(self) -> float:
        """Smallest friction coefficient that holds the lower edge at the start of the motion.

        It is (g sin θ − α h/2)/(g cos θ + α w/2) with the initial angular acceleration α, width w and height h.
        """
        alpha = self.angular_acceleration
        width, _, height = self.size
        tangential = self.gravity * sin(self.slope) - 0.5 * alpha * height
        return tangential / (self.gravity * cos(self.slope) + 0.5 * alpha * width)

    def angular_velocity(self, angle: float) -> float:
        """Return the angular velocity [rad/s] after rotation about the lower edge by ``angle`` [rad].

        The angular velocity follows from conservation of energy, and is 0 if the box does not tip.
        """
        descent = cos(self.lean) - cos(self.lean + angle)
        return float(np.sqrt(1.5 * self.gravity / self.arm * descent)) if self.tips else 0.0

    def tilt(self, state: State) -> float:
        """Return the angle [rad] by which the box has rotated downhill from its initial orientation."""
        rotation = rotation_matrices(state.position[None, 3:7])[0]
        return float(np.arctan2(rotation[0, 2], rotation[2, 2])) - self.slope

    def system(self) -> RigidBodies:
        """Return the box on its incline."""
        effects = (Gravity(self.gravity), Friction(self.friction))
        return rigid_bodies([Box(self.size)], np.array([self.mass]), [incline(self.slope)], effects)

    def start(self) -> State:
        """Return the box at rest."""
        centre = (0.5 * self.size[2] - OVERLAP) * incline_normal(self.slope)
        return State(0.0, np.concatenate([centre, about(Y_AXIS, self.slope)]), np.zeros(6))

    @property
    def observables(self) -> Sequence[Observable]:
        """The angle by which the box has rotated."""
        return (Observable("tilt", self.tilt, label="tilt [rad]", head="tilt"),)


@dataclass(frozen=True)
class BoxStack(ClosedFormScene):
    """A stack of boxes of equal size, at rest on level ground; each mass is the same multiple of the one below.

    Attributes:
        n_boxes: number of boxes.
        ratio: mass of the heaviest box divided by that of the lightest.
        heavy_on_top: whether masses increase upwards.
        friction: μ, or None for contacts without friction.
        overlap: initial penetration of each contact [m].
        size: edge lengths of a box along x, y and z [m].
        mass: mass of the lightest box [kg].
        gravity: g [m/s²].

    Raises:
        ProblemError: if there is no box, the size or the mass is not positive, the ratio is less than 1, or the overlap
            is outside [0, height).
    """

    n_boxes: int = 10
    ratio: float = 1.0
    heavy_on_top: bool = False
    friction: float | None = 0.5
    overlap: float = RESTING_OVERLAP
    size: Size = (0.2, 0.2, 0.1)
    mass: float = 1.0
    gravity: float = 9.81

    def __post_init__(self) -> None:
        _check_box(self.size, 0.0, self.overlap)
        check_positive(self, "a stack of boxes", "n_boxes", "mass")
        if not 1.0 <= self.ratio < inf:
            raise ProblemError(f"ratio of a stack must be at least 1, got {self.ratio}.")

    @property
    def masses(self) -> FloatArray:
        """Masses from the lowest box up [kg], shape (n_boxes,)."""
        ascending = self.mass * self.ratio ** np.linspace(0.0, 1.0, self.n_boxes)
        return ascending if self.heavy_on_top else ascending[::-1]

    def system(self) -> RigidBodies:
        """Return the boxes on the ground z = 0."""
        effects: list[BodyEffect] = [Gravity(self.gravity)]
        if self.friction is not None:
            effects.append(Friction(self.friction))
        return rigid_bodies([Box(self.size)] * self.n_boxes, self.masses, [incline(0.0)], effects)

    def exact(self, time: float) -> State:
        """Return the state at ``time`` [s]: the boxes stay at rest."""
        centres, n_below = np.zeros((self.n_boxes, 3)), np.arange(self.n_boxes)
        centres[:, 2] = (n_below + 0.5) * self.size[2] - (n_below + 1) * self.overlap
        return State(time, upright_poses(centres).ravel(), np.zeros(6 * self.n_boxes))

    def drift(self, state: State) -> float:
        """Return the largest displacement of a centre from the start [m]."""
        displacements = (state.position - self.exact(0.0).position).reshape(-1, 7)[:, :3]
        return float(np.linalg.norm(displacements, axis=1).max())

    @property
    def observables(self) -> Sequence[Observable]:
        """The largest displacement of a centre from the start."""
        return (Observable("drift", self.drift, label="drift [m]", head="drift"),)
