"""Coefficients of contacts by the materials of their two bodies."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ....arrays import FloatArray, IntArray
from ....errors import ProblemError


@dataclass(frozen=True, eq=False)
class MaterialPairs:
    """Coefficients by pairs of materials, which a system accepts as its friction or restitution.

    ``MaterialPairs(("steel", "steel", "wood"), {("steel", "steel"): 0.15, ("steel", "wood"): 0.4}, n_fixed=1)``

    Attributes:
        materials: the material of each body, fixed ones last.
        coefficients: coefficient of each pair of materials, in either order.
        n_fixed: number of fixed bodies, which do not touch each other.

    Raises:
        ProblemError: if a coefficient is negative or not finite, or a pair of bodies has none.
    """

    materials: Sequence[str]
    coefficients: Mapping[tuple[str, str], float]
    n_fixed: int = 0

    def __post_init__(self) -> None:
        for (first, second), value in self.coefficients.items():
            if not 0.0 <= value < np.inf:
                raise ProblemError(
                    f"the coefficient of {first} on {second} must be finite and not negative, got {value}."
                )
        n_moving = len(self.materials) - self.n_fixed
        for body, first in enumerate(self.materials[:n_moving]):
            for second in self.materials[body + 1 :]:
                if not {(first, second), (second, first)} & self.coefficients.keys():
                    raise ProblemError(
                        f"the coefficient of {first} on {second} is missing; add ({first!r}, {second!r})."
                    )

    def check_count(self, name: str, n_bodies: int) -> None:
        """Check the number of materials of the coefficient ``name`` of a system.

        Raises:
            ProblemError: if there are not ``n_bodies`` materials, one for each body, including fixed ones.
        """
        if len(self.materials) != n_bodies:
            raise ProblemError(
                f"{name} names the materials of {len(self.materials)} bodies, but there are {n_bodies}; give one "
                "material per body, those of fixed bodies last."
            )

    @cached_property
    def _names(self) -> list[str]:
        return sorted(set(self.materials))

    @cached_property
    def _material_of_body(self) -> IntArray:
        return np.array([self._names.index(name) for name in self.materials], dtype=np.int64)

    @cached_property
    def _table(self) -> FloatArray:
        names = self._names
        table = np.zeros((len(names), len(names)))
        for (first, second), value in self.coefficients.items():
            if first in names and second in names:
                table[names.index(first), names.index(second)] = table[names.index(second), names.index(first)] = value
        return table

    def __call__(self, pairs: IntArray) -> FloatArray:
        """Return the coefficient of each contact from the keys of the pairs of bodies, both of shape (n_contacts,)."""
        first, second = np.divmod(pairs, len(self.materials))
        coefficients: FloatArray = self._table[self._material_of_body[first], self._material_of_body[second]]
        return coefficients
