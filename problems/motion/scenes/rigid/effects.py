"""Effects that apply to rigid bodies only; the effects of ``scenes.effects`` except ``Planar`` also apply to them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from ....arrays import FloatArray
from ....errors import ProblemError
from ...bodies.rigid.rigid_bodies import FixedBody, RigidBodies
from ...bodies.rigid.shapes import Shape
from ..effects import check_distinct

ROLLING_ROWS = {"spinning": 1, "rolling": 2, "both": 3}
"""Number of rows of rolling friction, by the axes about which it acts."""


class BodyEffect(Protocol):
    """An effect on rigid bodies."""

    def added_to(self, system: RigidBodies) -> RigidBodies:
        """Return the system with this effect."""
        ...


@dataclass(frozen=True)
class RollingResistance:
    """Rolling friction at all contacts: a moment of at most μ_r Λ_N against the relative rotation.

    Attributes:
        coefficient: μ_r [m].
        axes: "rolling" in the plane of contact, "spinning" about the normal, or "both" with one bound.

    Raises:
        ProblemError: if the axes are unknown.
    """

    coefficient: float
    axes: str = "rolling"

    def __post_init__(self) -> None:
        if self.axes not in ROLLING_ROWS:
            raise ProblemError(
                f"axes of rolling resistance must be one of {', '.join(ROLLING_ROWS)}; got {self.axes!r}."
            )

    def added_to(self, system: RigidBodies) -> RigidBodies:
        """Return the system with laws of rolling friction."""
        return replace(system, rolling_friction=self.coefficient, rolling_axes=ROLLING_ROWS[self.axes])


@dataclass(frozen=True)
class GyroscopicMoment:
    """The moment −ω × Jω in body axes, which changes the axis of a free rotation."""

    def added_to(self, system: RigidBodies) -> RigidBodies:
        """Return the system with Euler's equations."""
        return replace(system, is_gyroscopic=True)


def rigid_bodies(
    shapes: Sequence[Shape], masses: FloatArray, fixed_bodies: Sequence[FixedBody], effects: Sequence[BodyEffect]
) -> RigidBodies:
    """Return a system of homogeneous bodies with ``masses`` [kg], shape (n,), fixed bodies, and ``effects``.

    Raises:
        ProblemError: if an effect is listed twice, or a number is out of range.
    """
    check_distinct(effects)
    system = RigidBodies(shapes, masses, fixed_bodies)
    for effect in effects:
        system = effect.added_to(system)
    return system
