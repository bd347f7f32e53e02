"""A row of dominoes: the first one is pushed, and a wave of falling dominoes runs along the row.

A domino that hits the next one keeps leaning on it, so that the whole train behind the wave pushes its head (D. E.
Shaw, *Mechanics of a chain of dominoes*, Am. J. Phys. 46, 640, 1978). Dominoes of height h and thickness d that stand p
apart, and do not slip on the ground, lean by angles with

    h sin(θ_{i−1} − θ_i) = p cos θ_i − d,

so that the train moves with one degree of freedom. Without friction between dominoes it conserves its energy between
impacts. At an impact, contact forces do no work on the motion of the longer train, Σ w_j (ω_j⁺ − ω_j⁻) = 0 with
w_j = ω_j/ω_n. The speed of the wave tends to a limit that is independent of the push. Friction slows the wave (J. M.
J. van Leeuwen, *The domino effect*, Am. J. Phys. 78, 721, 2010, arXiv:physics/0401018). For thin dominoes, speeds scale
with (g h)^½ at equal p/h (McLachlan, Beaupre, Cox & Gore, *Falling dominoes*, SIAM Review 25, 403, 1983).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import asin, hypot, inf, sqrt

import numpy as np

from ....arrays import FloatArray
from ....errors import ProblemError
from ...bodies.rigid.materials import MaterialPairs
from ...bodies.rigid.rigid_bodies import RigidBodies
from ...bodies.rigid.shapes import Box
from ...state import State
from ..effects import Friction, Gravity
from ..scene import Observable, check_positive
from .boxes import Size, incline, upright_poses
from .effects import rigid_bodies

RESTING_DEPTH = 1e-6
"""Depth [m] of standing dominoes in the ground; see ``scene.RESTING_OVERLAP``. It reduces levers."""

TRAIN = 40
"""Number of impacts after which the speed of the wave counts as its limit."""

ANGLES = 200
"""Number of angles between two impacts at which the theory computes the speed of the train."""


@dataclass(frozen=True)
class Dominoes:
    """A row of dominoes along x; the first one starts to turn about its lower edge.

    Attributes:
        n_dominoes: number of dominoes.
        spacing: gap between two dominoes [m].
        push: angular velocity of the first domino [rad/s].
        friction: μ between dominoes.
        ground_friction: μ of dominoes on the ground.
        size: thickness along x, width and height of a domino [m].
        mass: mass of a domino [kg].
        gravity: g [m/s²].

    Raises:
        ProblemError: if a number is not positive, a domino cannot reach the next one, or the push does not topple
            the first one.
    """

    n_dominoes: int = 20
    spacing: float = 0.02
    push: float = 6.0
    friction: float = 0.2
    ground_friction: float = 0.8
    size: Size = (0.008, 0.024, 0.048)
    mass: float = 0.01
    gravity: float = 9.81

    def __post_init__(self) -> None:
        check_positive(self, "a row of dominoes", "n_dominoes", "spacing", "push", "mass", "gravity")
        Box(self.size)
        if self.spacing >= self.size[2]:
            raise ProblemError(
                f"spacing of dominoes must be less than their height {self.size[2]:g}, got {self.spacing}."
            )
        if self.push <= self.toppling_push:
            raise ProblemError(
                f"push of the first domino must be above {self.toppling_push:.4g} to topple it, got {self.push}; "
                "increase it."
            )

    @property
    def pitch(self) -> float:
        """Distance p between equal points of adjacent dominoes [m]."""
        return self.spacing + self.size[0]

    @property
    def toppling_push(self) -> float:
        """Smallest angular velocity that topples a domino [rad/s]: ½ J ω² lifts its centre above its edge."""
        diagonal = hypot(self.size[0], self.size[2])
        return sqrt(3.0 * self.gravity * (diagonal - self.size[2])) / diagonal

    @property
    def hitting_angle(self) -> float:
        """Angle at which a domino hits the next one, which stands [rad]."""
        return asin(self.spacing / self.size[2])

    def system(self) -> RigidBodies:
        """Return the dominoes on the ground z = 0."""
        materials = (*["domino"] * self.n_dominoes, "ground")
        coefficients = {("domino", "domino"): self.friction, ("domino", "ground"): self.ground_friction}
        friction = Friction(MaterialPairs(materials, coefficients, n_fixed=1))
        masses = np.full(self.n_dominoes, self.mass)
        return rigid_bodies(
            [Box(self.size)] * self.n_dominoes, masses, [incline(0.0)], [Gravity(self.gravity), friction]
        )

    def start(self) -> State:
        """Return the upright dominoes, the first one in motion."""
        thickness, _, height = self.size
        centres, twists = np.zeros((self.n_dominoes, 3)), np.zeros((self.n_dominoes, 6))
        centres[:, 0] = self.pitch * np.arange(self.n_dominoes)
        centres[:, 2] = 0.5 * height - RESTING_DEPTH
        twists[0] = 0.5 * self.push * np.array([height, 0.0, thickness, 0.0, 2.0, 0.0])
        return State(0.0, upright_poses(centres).ravel(), twists.ravel())

    def angles(self, state: State) -> FloatArray:
        """Return the rotation angles of the dominoes [rad], shape (n_dominoes,)."""
        poses = state.position.reshape(-1, 7)
        turned: FloatArray = 2.0 * np.arctan2(poses[:, 5], poses[:, 3])
        return turned

    def front(self, state: State) -> float:
        """Return the position of the wave [m]; each domino counts by its angle divided by that of its impact."""
        return self.pitch * float(np.clip(self.angles(state) / self.hitting_angle, 0.0, 1.0).sum())

    @property
    def observables(self) -> Sequence[Observable]:
        """The position of the wave."""
        return (Observable("front", self.front, label="front of the wave [m]", head="front", rate="wave speed"),)

    @cached_property
    def frictionless_speed(self) -> float:
        """Limit of the speed of the wave [m/s] without friction between dominoes, and without slip on the ground."""
        heads = np.linspace(0.0, self.hitting_angle, ANGLES)
        angles, rates = self._train(heads)
        thickness, _, height = self.size
        moment = (height**2 + thickness**2) / 3.0
        potential = 0.5 * self.gravity * (height * np.cos(angles) + thickness * np.sin(angles))
        head_speed, seconds = self.push, inf  # of the head after an impact; time from it to the next one
        for n in range(1, TRAIN):
            # n dominoes move; inertia and energies are divided by the mass
            inertia = moment * (rates[:n] ** 2).sum(axis=0)
            released = (potential[:n, :1] - potential[:n]).sum(axis=0)
            squared = (inertia[0] * head_speed**2 + 2.0 * released) / inertia
            if not (squared > 0.0).all():
                raise ProblemError("the wave stops because the push of the first domino is too weak; increase it.")
            head_speeds = np.sqrt(squared)
            seconds = float(np.trapezoid(1.0 / head_speeds, heads))
            before, after = rates[:n, -1] * head_speeds[-1], rates[: n + 1, 0]
            head_speed = float(after[1:] @ before / (after @ after))
        return self.pitch / seconds

    def _train(self, heads: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the angles [rad] and the rates w of a train whose head leans by ``heads`` [rad].

        Returns:
            From the head backwards, shape (TRAIN + 1, len(heads)) each.
        """
        thickness, _, height = self.size
        angles, rates = [heads], [np.ones(len(heads))]
        for _ in range(TRAIN):
            sine = (self.pitch * np.cos(angles[-1]) - thickness) / height
            slope = self.pitch * np.sin(angles[-1]) / height / np.sqrt(1.0 - sine * sine)
            angles.append(angles[-1] + np.arcsin(sine))
            rates.append(rates[-1] * (1.0 - slope))
        return np.array(angles), np.array(rates)
