"""Effects of a scene, such as gravity and friction.

A system contains only the effects that its scene lists, so absent effects take no time. Each effect is a class
that adds itself to a system of balls or, except ``Planar``, of rigid bodies. Steppers and solvers do not depend on
effects.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol, TypeVar, runtime_checkable

import numpy as np

from ...arrays import FloatArray, check_number, real_numbers
from ...errors import ProblemError
from ..bodies.balls import DISC_INERTIA, BallSystem, PairCoefficient
from ..bodies.rigid.rigid_bodies import RigidBodies
from ..bodies.surfaces import Surface

System = TypeVar("System", BallSystem, RigidBodies)
"""Type of a system to which an effect is added."""


class Effect(Protocol):
    """An effect that can be added to a system of balls."""

    def added_to(self, system: BallSystem) -> BallSystem:
        """Return a copy of the system with this effect."""
        ...


@runtime_checkable
class Conservative(Protocol):
    """An effect whose forces have a potential."""

    def potential_energy(self, centres: FloatArray, masses: FloatArray) -> float:
        """Return V [J] of bodies with ``masses`` [kg], shape (n,), at ``centres`` [m], shape (n, d)."""
        ...


class Force(ABC):
    """An effect that accelerates the centres of bodies.

    The potential energy of a system is known only if each of its forces is ``Conservative`` or dissipative. A subclass
    that overrides only ``accelerate`` counts as neither, because the inherited description may not fit its force.

    Attributes:
        is_dissipative: whether the force only dissipates energy, and therefore has no potential energy.
    """

    is_dissipative: ClassVar[bool] = False

    def added_to(self, system: System) -> System:
        """Return a copy of the system with this force."""
        potential = None
        if self.is_dissipative and self._matches_acceleration("is_dissipative"):
            potential = _zero_energy
        elif isinstance(self, Conservative) and self._matches_acceleration("potential_energy"):
            potential = self.potential_energy
        return replace(
            system,
            accelerations=(*system.accelerations, self.accelerate),
            potentials=(*system.potentials, potential),
        )

    def _matches_acceleration(self, name: str) -> bool:
        """Return whether the attribute ``name`` describes the force of ``accelerate``.

        It does unless a subclass of the class that defines ``name`` overrides ``accelerate``.
        """
        describing_class, accelerating_class = (
            next(base for base in type(self).__mro__ if key in vars(base)) for key in (name, "accelerate")
        )
        return issubclass(describing_class, accelerating_class)

    @abstractmethod
    def accelerate(self, centres: FloatArray, velocities: FloatArray, masses: FloatArray) -> FloatArray:
        """Return the accelerations h/m [m/s²], shape (n, d), where h is the force.

        Args:
            centres: positions of the centres [m], shape (n, d).
            velocities: velocities of the centres [m/s], shape (n, d).
            masses: m [kg], shape (n,).
        """


def _zero_energy(centres: FloatArray, masses: FloatArray) -> float:
    return 0.0


@dataclass(frozen=True)
class Gravity(Force):
    """Weight: h = −m g along the last axis.

    Attributes:
        acceleration: g [m/s²].

    Raises:
        ProblemError: if the acceleration is not finite.
    """

    acceleration: float = 9.81

    def __post_init__(self) -> None:
        check_number("acceleration of gravity", self.acceleration)

    def accelerate(self, centres: FloatArray, velocities: FloatArray, masses: FloatArray) -> FloatArray:
        """Return −g along the last axis [m/s²]."""
        accelerations = np.zeros(centres.shape)
        accelerations[:, -1] = -self.acceleration
        return accelerations

    def potential_energy(self, centres: FloatArray, masses: FloatArray) -> float:
        """Return V = Σ m g z [J]."""
        return self.acceleration * float(masses @ centres[:, -1])


@dataclass(frozen=True)
class Drag(Force):
    """Linear drag: h = −k v on each centre.

    Attributes:
        coefficient: k [kg/s].

    Raises:
        ProblemError: if the coefficient is negative or not finite.
    """

    coefficient: float

    is_dissipative: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_number("coefficient of drag", self.coefficient, 0.0)

    def accelerate(self, centres: FloatArray, velocities: FloatArray, masses: FloatArray) -> FloatArray:
        """Return −k v/m [m/s²]."""
        return -self.coefficient / masses[:, None] * velocities


@dataclass(frozen=True)
class Spring(Force):
    """A linear spring from each centre to an anchor: h = −k (x − x_0).

    Attributes:
        stiffness: k [N/m].
        anchor: x_0 [m], d numbers.

    Raises:
        ProblemError: if a number is not finite.
    """

    stiffness: float
    anchor: tuple[float, ...]

    def __post_init__(self) -> None:
        check_number("stiffness of a spring", self.stiffness)
        anchor = real_numbers(self.anchor, "anchor of a spring")
        if anchor.ndim != 1 or not np.isfinite(anchor).all():
            raise ProblemError(f"stiffness and anchor of a spring must be finite, got {self.stiffness}, {self.anchor}.")

    def accelerate(self, centres: FloatArray, velocities: FloatArray, masses: FloatArray) -> FloatArray:
        """Return −k (x − x_0)/m [m/s²]."""
        force: FloatArray = -self.stiffness * (centres - np.array(self.anchor))
        return force / masses[:, None]

    def potential_energy(self, centres: FloatArray, masses: FloatArray) -> float:
        """Return V = Σ k |x − x_0|²/2 [J]."""
        return 0.5 * self.stiffness * float(((centres - np.array(self.anchor)) ** 2).sum())


@dataclass(frozen=True)
class Friction:
    """Coulomb friction at all contacts. It adds rotational degrees of freedom to balls.

    Attributes:
        coefficient: μ of all contacts, or a function that maps keys of pairs of bodies to their μ.
    """

    coefficient: float | PairCoefficient

    def added_to(self, system: System) -> System:
        """Return a copy of the system with friction laws."""
        return replace(system, friction=self.coefficient)


@dataclass(frozen=True)
class Restitution:
    """Newton's impact law γ⁺ = −ε γ⁻ for the relative velocities of all contacts after and before an impact.

    Attributes:
        normal: ε_N of all contacts, or a function that maps keys of pairs of bodies to their ε_N.
        tangential: ε_T of all contacts.
    """

    normal: float | PairCoefficient
    tangential: float = 0.0

    def added_to(self, system: System) -> System:
        """Return a copy of the system with restitution."""
        return replace(system, restitution_normal=self.normal, restitution_tangential=self.tangential)


@dataclass(frozen=True)
class Planar:
    """Restriction of the motion to the vertical plane (x, z), with planar friction.

    Attributes:
        inertia_factor: J/(m r²) about the normal of the plane; by default, that of a disc.
    """

    inertia_factor: float = DISC_INERTIA

    def added_to(self, system: BallSystem) -> BallSystem:
        """Return a copy of the system in two dimensions.

        Raises:
            ProblemError: if the bodies of the system are not balls.
        """
        if not isinstance(system, BallSystem):
            raise ProblemError("only balls can move in a plane; omit Planar from the effects on rigid bodies.")
        return replace(system, dimension=2, inertia_factor=self.inertia_factor)


def ball_system(
    radii: FloatArray, masses: FloatArray, surfaces: Sequence[Surface], effects: Sequence[Effect]
) -> BallSystem:
    """Return a system of balls.

    Args:
        radii: radii of the balls [m], shape (n,).
        masses: masses of the balls [kg], shape (n,).
        surfaces: fixed surfaces that the balls can touch.
        effects: effects to add, each of a different class.

    Raises:
        ProblemError: if an effect is listed twice, or a number is out of range.
    """
    check_distinct(effects)
    system = BallSystem(radii, masses, surfaces, dimension=3)
    for effect in effects:
        system = effect.added_to(system)
    return system


def check_distinct(effects: Sequence[object]) -> None:
    """Check that no effect is listed twice.

    Raises:
        ProblemError: if two effects have the same class.
    """
    names = [type(effect).__name__ for effect in effects]
    for name in names:
        if names.count(name) > 1:
            raise ProblemError(f"the effect {name} is listed {names.count(name)} times; list it once.")
