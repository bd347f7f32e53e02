"""Scenes of many boxes, from which problems are generated: a pile, a table, and a train."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cbrt, ceil, hypot, pi

import numpy as np

from ....problems.arrays import FloatArray
from ....problems.motion.bodies.rigid.joints import Joint, RigidJoints
from ....problems.motion.bodies.rigid.orientation import about
from ....problems.motion.bodies.rigid.rigid_bodies import FixedBody, RigidBodies
from ....problems.motion.bodies.rigid.shapes import Box, HalfSpace
from ....problems.motion.scenes.effects import Friction, Gravity
from ....problems.motion.scenes.rigid.boxes import Size
from ....problems.motion.scenes.rigid.effects import rigid_bodies
from ....problems.motion.scenes.scene import OVERLAP, check_positive
from ....problems.motion.state import State

WALLS = (((-1.0, 0.0), (0.0, 1.0, 0.0), 0.5 * pi), ((1.0, 0.0), (0.0, 1.0, 0.0), -0.5 * pi))
"""Direction from the middle, and axis and angle of the rotation of the ground, for each wall across x. For walls across
y, x and y are exchanged and the angle is negated."""

EFFECTS = (Gravity(), Friction(0.5))
"""Effects of all scenes in this module."""


@dataclass(frozen=True)
class BoxPile:
    """Equal boxes of random orientation, in layers above the ground between four walls, which fall into a pile.

    Attributes:
        n_boxes: number of boxes.
        seed: seed of the orientations.
        size: edge lengths of a box [m].
        mass: mass of a box [kg].
        spacing: distance between neighbours relative to the diagonal of a box, more than 1.

    Raises:
        ProblemError: if a number is not positive.
    """

    n_boxes: int
    seed: int = 1
    size: Size = (0.06, 0.05, 0.04)
    mass: float = 0.1
    spacing: float = 1.02

    def __post_init__(self) -> None:
        check_positive(self, "a pile of boxes", "n_boxes", "mass", "spacing")

    @property
    def pitch(self) -> float:
        """Distance between neighbours at the start [m]."""
        return self.spacing * hypot(*self.size)

    @property
    def side(self) -> int:
        """Boxes along each side of a layer; a pile is 1.5 times as high as wide."""
        return ceil(cbrt(self.n_boxes / 1.5))

    def system(self) -> RigidBodies:
        """Return the boxes between the walls."""
        half_width = 0.5 * self.side * self.pitch
        fixed_bodies = [FixedBody(HalfSpace())]
        for (x, y), (a, b, c), angle in WALLS:
            fixed_bodies.append(
                FixedBody(HalfSpace(), (half_width * x, half_width * y, 0.0), tuple(about((a, b, c), angle)))
            )
            fixed_bodies.append(
                FixedBody(HalfSpace(), (half_width * y, half_width * x, 0.0), tuple(about((b, a, c), -angle)))
            )
        return rigid_bodies([Box(self.size)] * self.n_boxes, np.full(self.n_boxes, self.mass), fixed_bodies, EFFECTS)

    def start(self) -> State:
        """Return the boxes at rest above the ground."""
        box, side = np.arange(self.n_boxes), self.side
        cells = np.column_stack([box % side, box // side % side, box // side**2]) + 0.5
        centres = self.pitch * (cells - [0.5 * side, 0.5 * side, 0.0])
        orientations = np.random.default_rng(self.seed).normal(size=(self.n_boxes, 4))
        orientations /= np.linalg.norm(orientations, axis=1)[:, None]
        return State(0.0, np.hstack([centres, orientations]).ravel(), np.zeros(6 * self.n_boxes))


@dataclass(frozen=True)
class BoxTable:
    """A slab at rest on posts, which stand in a square grid on the ground.

    Attributes:
        posts: number of posts along each side.
        ratio: mass of the slab over that of a post.
        size: edge lengths of a post [m].
        mass: mass of a post [kg].

    Raises:
        ProblemError: if a number is not positive.
    """

    posts: int
    ratio: float = 1.0
    size: Size = (0.05, 0.05, 0.2)
    mass: float = 1.0

    def __post_init__(self) -> None:
        check_positive(self, "a table", "posts", "ratio", "mass")

    @property
    def slab(self) -> Box:
        """The slab, which extends beyond its outer posts by half their width."""
        width, depth, height = self.size
        return Box((2.0 * self.posts * width, 2.0 * self.posts * depth, 0.25 * height))

    def system(self) -> RigidBodies:
        """Return the posts, then the slab, on the ground."""
        masses = np.append(np.full(self.posts**2, self.mass), self.ratio * self.mass)
        shapes = [*[Box(self.size)] * self.posts**2, self.slab]
        return rigid_bodies(shapes, masses, [FixedBody(HalfSpace())], EFFECTS)

    def start(self) -> State:
        """Return the bodies at rest; all faces overlap slightly."""
        post, height = np.arange(self.posts**2), self.size[2]
        cells = np.column_stack([post // self.posts, post % self.posts]) - 0.5 * (self.posts - 1)
        centres = np.column_stack([2.0 * cells * self.size[:2], np.full(len(post), 0.5 * height - OVERLAP)])
        slab = [0.0, 0.0, height + 0.5 * self.slab.size[2] - 2.0 * OVERLAP]
        return _upright(np.vstack([centres, slab]))


@dataclass(frozen=True)
class BoxTrain:
    """Boxes in a row on the ground, each joined to the next by a ball joint; the first one is struck.

    Attributes:
        n_boxes: number of boxes.
        ratio: mass of the first box over that of each other box.
        speed: initial velocity of the first box along the row, away from the others [m/s].
        size: edge lengths along the row, across it, and normal to the ground [m].
        gap: distance between neighbours [m].
        mass: mass of a box [kg].

    Raises:
        ProblemError: if a number is not positive.
    """

    n_boxes: int
    ratio: float = 1.0
    speed: float = 1.0
    size: Size = (0.2, 0.1, 0.1)
    gap: float = 0.04
    mass: float = 1.0

    def __post_init__(self) -> None:
        check_positive(self, "a train of boxes", "n_boxes", "ratio", "gap", "mass")

    @property
    def joints(self) -> Sequence[Joint]:
        """The joints, halfway between neighbours, from the first joint on."""
        reach = 0.5 * (self.size[0] + self.gap)
        return [Joint("ball", box, box + 1, (-reach, 0.0, 0.0), (reach, 0.0, 0.0)) for box in range(self.n_boxes - 1)]

    def system(self) -> RigidBodies:
        """Return the boxes on the ground."""
        masses = self.mass * np.append(self.ratio, np.ones(self.n_boxes - 1))
        system = rigid_bodies([Box(self.size)] * self.n_boxes, masses, [FixedBody(HalfSpace())], EFFECTS)
        return replace(system, joints=RigidJoints(self.joints, self.n_boxes))

    def start(self) -> State:
        """Return the boxes, at rest except for the first one."""
        x = -(self.size[0] + self.gap) * np.arange(self.n_boxes)
        height = np.full(self.n_boxes, 0.5 * self.size[2] - OVERLAP)
        state = _upright(np.column_stack([x, np.zeros(self.n_boxes), height]))
        state.velocity[0] = self.speed
        return state


def _upright(centres: FloatArray) -> State:
    """Return boxes at rest without rotation, at centres [m], shape (n, 3)."""
    orientations = np.tile([1.0, 0.0, 0.0, 0.0], (len(centres), 1))
    return State(0.0, np.hstack([centres, orientations]).ravel(), np.zeros(6 * len(centres)))
