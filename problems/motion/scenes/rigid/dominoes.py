"""A row of dominoes: the first one is pushed, and a wave of falling dominoes runs along the row.

A domino that hits the next one keeps leaning on it, so that the whole train of fallen dominoes pushes its head (D. E.
Shaw, *Mechanics of a chain of dominoes*, Am. J. Phys. 46, 640, 1978). Dominoes of height h and thickness d that stand p
apart, and do not slip on the ground, lean by angles with

    h sin(θ_{i−1} − θ_i) = p cos θ_i − d,

so that the train moves with one degree of freedom, θ_i = θ_i(θ_n) with the rates w_i = dθ_i/dθ_n. The corner of domino
i slides down the face of the next one. The normal force f_i between them and its friction μ f_i have moments about the
lower edges, −f_i a_i on domino i and f_i b_i on the next one, with φ = θ_i − θ_{i+1} and

    a_i = h (cos φ + μ sin φ),      b_i = h cos φ − p sin θ_{i+1} − μ d.

The factors c_n = 1, c_i = c_{i+1} b_i/a_i eliminate these forces from the equations of motion: Σ c_i (J θ̈_i − T_i) = 0
between impacts, with the moments T_i of gravity, and Σ c_i (ω_i⁺ − ω_i⁻) = 0 over all dominoes of the longer train
at an impact. The speed of the wave tends to a limit that is independent of the push. Without friction, c_i = w_i, and
the train conserves its energy between impacts. Friction slows the wave (J. M. J. van Leeuwen, *The domino effect*, Am.
J. Phys. 78, 721, 2010, arXiv:physics/0401018). For thin dominoes, speeds scale with (g h)^½ at equal p/h (McLachlan,
Beaupre, Cox & Gore, *Falling dominoes*, SIAM Review 25, 403, 1983).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import asin, hypot, sqrt

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
"""Depth [m] of upright dominoes in the ground, which shortens lever arms; see ``scene.RESTING_OVERLAP``."""

N_IMPACTS = 40
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
        ProblemError: if a length, the number of dominoes, the push, the mass or gravity is not positive, a domino
            cannot reach the next one, or the push does not topple the first domino.
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
        """Distance p between corresponding points of adjacent dominoes [m]."""
        return self.spacing + self.size[0]

    @property
    def toppling_push(self) -> float:
        """Smallest angular velocity that topples a domino [rad/s]: ½ J ω² lifts its centre above its edge."""
        diagonal = hypot(self.size[0], self.size[2])
        return sqrt(3.0 * self.gravity * (diagonal - self.size[2])) / diagonal

    @property
    def hitting_angle(self) -> float:
        """Angle at which a domino hits the next one, which is upright [rad]."""
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
        rotation_angles: FloatArray = 2.0 * np.arctan2(poses[:, 5], poses[:, 3])
        return rotation_angles

    def front(self, state: State) -> float:
        """Return the position of the wave [m]: p times the sum of angles over ``hitting_angle``, each at most 1."""
        return self.pitch * float(np.clip(self.angles(state) / self.hitting_angle, 0.0, 1.0).sum())

    @property
    def observables(self) -> Sequence[Observable]:
        """The position of the wave."""
        return (Observable("front", self.front, label="front of the wave [m]", head="front", rate="wave speed"),)

    @cached_property
    def limit_speed(self) -> float:
        """Limit of the speed of the wave [m/s] by the theory, without slip on the ground.

        Raises:
            ProblemError: if the push is too weak, or friction too strong for a wave.
        """
        return self.pitch / float(self.intervals[-1])

    @cached_property
    def intervals(self) -> FloatArray:
        """Times from each impact to the next one [s] by the theory, shape (N_IMPACTS − 1,).

        Raises:
            ProblemError: if the push is too weak, or friction too strong for a wave.
        """
        head_angles = np.linspace(0.0, self.hitting_angle, ANGLES)
        angles, rates, weights = self._train(head_angles)
        rate_derivatives = np.gradient(rates, head_angles, axis=1, edge_order=2)
        thickness, _, height = self.size
        # inertia and moments are divided by the mass
        inertia = (height**2 + thickness**2) / 3.0
        moments = 0.5 * self.gravity * (height * np.sin(angles) - thickness * np.cos(angles))
        head_speed, seconds = self.push, []  # speed of the head after an impact; times between impacts
        for n in range(1, N_IMPACTS):
            # n dominoes move; y = ω² of the head has dy/dθ + P y = Q
            c = weights[:n]
            effective_inertia = inertia * (c * rates[:n]).sum(axis=0)
            exponent = 2.0 * inertia * (c * rate_derivatives[:n]).sum(axis=0) / effective_inertia
            growth = np.exp(_integral(exponent, head_angles))
            work = _integral(growth * 2.0 * (c * moments[:n]).sum(axis=0) / effective_inertia, head_angles)
            squared = (head_speed**2 + work) / growth
            if not (squared > 0.0).all():
                raise ProblemError("the wave stops; push the first domino harder, or reduce the friction.")
            head_speeds = np.sqrt(squared)
            seconds.append(float(np.trapezoid(1.0 / head_speeds, head_angles)))
            before, after = rates[:n, -1] * head_speeds[-1], rates[: n + 1, 0]
            c = weights[: n + 1, 0]
            head_speed = float(c[1:] @ before / (c @ after))
        return np.array(seconds)

    def _train(self, head_angles: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the angles [rad], rates w and factors c of a train whose head leans by ``head_angles`` [rad].

        Returns:
            From the head backwards, shape (N_IMPACTS + 1, len(head_angles)) each.

        Raises:
            ProblemError: if dominoes do not push each other because of their friction.
        """
        thickness, _, height = self.size
        angles, rates, weights = [head_angles], [np.ones(len(head_angles))], [np.ones(len(head_angles))]
        for _ in range(N_IMPACTS):
            sine = (self.pitch * np.cos(angles[-1]) - thickness) / height
            cosine, offset = np.sqrt(1.0 - sine * sine), self.pitch * np.sin(angles[-1])
            lever_arm = height * cosine - offset - self.friction * thickness
            if not (lever_arm > 0.0).all():
                raise ProblemError(f"dominoes with friction {self.friction} do not push each other; reduce it.")
            weights.append(weights[-1] * lever_arm / (height * (cosine + self.friction * sine)))
            rates.append(rates[-1] * (1.0 - offset / (height * cosine)))
            angles.append(angles[-1] + np.arcsin(sine))
        return np.array(angles), np.array(rates), np.array(weights)


def _integral(values: FloatArray, points: FloatArray) -> FloatArray:
    """Return the integral from the first of ``points`` to each point, by the trapezoidal rule."""
    from scipy.integrate import cumulative_trapezoid  # import takes 0.2 s

    integral: FloatArray = cumulative_trapezoid(values, points, initial=0)
    return integral
