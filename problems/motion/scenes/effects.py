"""Effects of a scene, such as gravity and friction; effects that are not listed cost nothing.

Each effect is a class that adds itself to a system of balls or, except ``Planar``, of rigid bodies. Steppers and
solvers do not depend on effects.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol, TypeVar, runtime_checkable

import numpy as np

from ...arrays import FloatArray
from ...errors import ProblemError
from ..bodies.balls import DISC_INERTIA, BallSystem, PairCoefficient
from ..bodies.rigid.rigid_bodies import RigidBodies
from ..bodies.surfaces import Surface

System = TypeVar("System", BallSystem, RigidBodies)
"""The systems that effects act on."""


class Effect(Protocol):
    """An effect on balls."""

    def added_to(self, system: BallSystem) -> BallSystem:
        """Return the system with this effect."""
        ...


@runtime_checkable
class Conservative(Protocol):
    """An effect whose forces have a potential."""

    def potential_energy(self, centres: FloatArray, masses: FloatArray) -> float:
        """Return V [J] of balls with masses [kg], shape (n,), at ``centres`` [m], shape (n, d)."""
        ...


class Force(ABC):
    """An effect that accelerates the centres of bodies.

    The potential energy of a system is known only if each of its forces is ``Conservative`` or dissipative. A class
    that overrides ``accelerate`` alone is neither.

    Attributes:
        is_dissipative: whether the force only dissipates energy, so that it has no potential energy.
    """

    is_dissipative: ClassVar[bool] = False

    def added_to(self, system: System) -> System:
        """Return the system with this force."""
        potential = None
        if self.is_dissipative and self._describes_its_force("is_dissipative"):
            potential = _no_energy
        elif isinstance(self, Conservative) and self._describes_its_force("potential_energy"):
            potential = self.potential_energy
        return replace(
            system,
            accelerations=(*system.accelerations, self.accelerate),
            potentials=(*system.potentials, potential),
        )

    def _describes_its_force(self, name: str) -> bool:
        """Return whether the class that defines ``name`` defines or inherits the acceleration in use."""
        described, accelerated = (
            next(one for one in type(self).__mro__ if key in vars(one)) for key in (name, "accelerate")
        )
        return issubclass(described, accelerated)

    @abstractmethod
    def accelerate(self, centres: FloatArray, velocities: FloatArray, masses: FloatArray) -> FloatArray:
        """Return h/m [m/s²] of centres [m] with velocities [m/s], shape (n, d), and masses [kg], shape (n,)."""


def _no_energy(centres: FloatArray, masses: FloatArray) -> float:
    return 0.0


@dataclass(frozen=True)
class Gravity(Force):
    """Weight: h = −m g along the last axis.

    Attributes:
        acceleration: g [m/s²].
    """

    acceleration: float = 9.81

    def accelerate(self, centres: FloatArray, velocities: FloatArray, masses: FloatArray) -> FloatArray:
        """Return −g along the last axis [m/s²]."""
        down = np.zeros_like(centres)
        down[:, -1] = -self.acceleration
        return down

    def potential_energy(self, centres: FloatArray, masses: FloatArray) -> float:
        """Return V = Σ m g z [J]."""
        return self.acceleration * float(masses @ centres[:, -1])


@dataclass(frozen=True)
class Drag(Force):
    """Linear drag: h = −k v on each centre.

    Attributes:
        coefficient: k [kg/s].
    """

    coefficient: float

    is_dissipative: ClassVar[bool] = True

    def accelerate(self, centres: FloatArray, velocities: FloatArray, masses: FloatArray) -> FloatArray:
        """Return −k v/m [m/s²]."""
        return -self.coefficient / masses[:, None] * velocities


@dataclass(frozen=True)
class Spring(Force):
    """A linear spring from each centre to an anchor: h = −k (x − x_0).

    Attributes:
        stiffness: k [N/m].
        anchor: x_0 [m], d numbers.
    """

    stiffness: float
    anchor: tuple[float, ...]

    def accelerate(self, centres: FloatArray, velocities: FloatArray, masses: FloatArray) -> FloatArray:
        """Return −k (x − x_0)/m [m/s²]."""
        force: FloatArray = -self.stiffness * (centres - np.array(self.anchor))
        return force / masses[:, None]

    def potential_energy(self, centres: FloatArray, masses: FloatArray) -> float:
        """Return V = Σ k |x − x_0|²/2 [J]."""
        return 0.5 * self.stiffness * float(((centres - np.array(self.anchor)) ** 2).sum())


@dataclass(frozen=True)
class Friction:
    """Coulomb friction at all contacts, which makes balls rotate.

    Attributes:
        coefficient: μ, or a function that maps keys of pairs of bodies to their μ.
    """

    coefficient: float | PairCoefficient

    def added_to(self, system: System) -> System:
        """Return the system with friction laws, and with rotational degrees of freedom of balls."""
        return replace(system, friction=self.coefficient)


@dataclass(frozen=True)
class Restitution:
    """Newton's impact law at all contacts, γ⁺ = −ε γ⁻.

    Attributes:
        normal: ε_N, or a function that maps keys of pairs of bodies to their ε_N.
        tangential: ε_T.
    """

    normal: float | PairCoefficient
    tangential: float = 0.0

    def added_to(self, system: System) -> System:
        """Return the system with restitution."""
        return replace(system, restitution_normal=self.normal, restitution_tangential=self.tangential)


@dataclass(frozen=True)
class Planar:
    """Bodies in a vertical plane, (x, z), with planar friction.

    Attributes:
        inertia_factor: J/(m r²) about the axis out of the plane; that of a disc by default.
    """

    inertia_factor: float = DISC_INERTIA

    def added_to(self, system: BallSystem) -> BallSystem:
        """Return the system in two dimensions."""
        return replace(system, dimension=2, inertia_factor=self.inertia_factor)


def ball_system(
    radii: FloatArray, masses: FloatArray, surfaces: Sequence[Surface], effects: Sequence[Effect]
) -> BallSystem:
    """Return the system of balls with radii [m] and masses [kg], shape (n,), among ``surfaces``, with ``effects``.

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
        ProblemError: for the first one that is.
    """
    names = [type(effect).__name__ for effect in effects]
    for name in names:
        if names.count(name) > 1:
            raise ProblemError(f"the effect {name} is listed {names.count(name)} times; list it once.")
