"""Contact problems as linear complementarity problems: find z ≥ 0 with w = M z + q ≥ 0 and zᵀw = 0.

Each law contributes unknowns and conditions; b = a + μ Λ_N is the friction bound.

* Unilateral contact: z = Λ_N, w = ξ_N.
* Planar friction, exact (Glocker & Studer 2005), in the distances to both bounds and both parts of the velocity:

      z = (Λ_T + b, ξ⁻),    w = (ξ⁺, b − Λ_T),    ξ_T = ξ⁺ − ξ⁻.

* Spatial friction with the inscribed k-gon in place of the disc (Stewart & Trinkle 1996): Λ_T = D β with the corners of
  the unit k-gon in the columns of D, and e = (1, …, 1),

      z = (β, λ),    w = (Dᵀξ_T + λ e, b − eᵀβ).

All quantities are scaled contact by contact, which equalises mass ratios: Λ = s z and w = s ξ with s = 1/√α.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...problems.arrays import FloatArray, IntArray
from ...problems.contact.laws import Laws
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ..iteration.method import check_option

_Entries = tuple[IntArray, IntArray, FloatArray | float]
"""Rows, columns and values of a sparse matrix, which are broadcast against each other."""


@dataclass(frozen=True, eq=False)
class Complementarity:
    """A linear complementarity problem, and the map from its solution to impulses.

    Attributes:
        matrix: M, sparse, shape (n, n).
        vector: q, shape (n,).
        to_impulses: Λ = to_impulses @ z + offset [N s], sparse, shape (n_rows, n).
        offset: the constant part of Λ [N s], shape (n_rows,).
    """

    matrix: sp.csr_array
    vector: FloatArray
    to_impulses: sp.csr_array
    offset: FloatArray

    def impulses(self, unknowns: FloatArray) -> FloatArray:
        """Return Λ [N s], shape (n_rows,), from z, shape (n,)."""
        impulses: FloatArray = self.to_impulses @ unknowns + self.offset
        return impulses


def check_sides(sides: int) -> None:
    """Raise ``SolverError`` unless ``sides`` is a valid number of sides of a polygon."""
    is_valid = isinstance(sides, int) and sides >= 3
    check_option("sides", sides, is_valid, "a whole number of at least 3, the sides of a friction pyramid")


def unknowns_of_laws(laws: Laws, sides: int) -> IntArray:
    """Return the number of unknowns of each law, shape (n_laws,)."""
    unknowns: IntArray = np.where(laws.is_friction, np.where(laws.row_count == 2, sides + 1, 2), 1)
    return unknowns


def corners(sides: int) -> FloatArray:
    """Return the corners of the regular polygon in the unit circle, shape (2, sides); the first is on the T1 axis."""
    angle = 2.0 * np.pi / sides * np.arange(sides)
    return np.stack([np.cos(angle), np.sin(angle)])


def complementarity(problem: ContactProblem, residual: Residual, sides: int) -> Complementarity:
    """Return the linear complementarity problem of ``problem`` with friction pyramids of ``sides`` sides.

    Args:
        problem: the contact problem.
        residual: the judge's residual of the problem, which provides α of each law.
        sides: number of sides of a pyramid, k; planar friction is exact for any k.
    """
    laws, scale, speed = problem.laws, _scales(problem, residual), residual.scale or 1.0
    law_scale = scale[laws.first_row]
    friction = laws.friction_coefficient * np.where(laws.partner >= 0, law_scale[laws.partner], 0.0) / law_scale
    conditions = _Conditions(laws, friction, laws.fixed_bound / law_scale / speed, sides)
    conditions.add_unilateral()
    conditions.add_planar()
    conditions.add_spatial()
    n_rows, n = len(scale), len(conditions.constant)
    impulse, velocity = _sparse(conditions.impulse, (n_rows, n)), _sparse(conditions.velocity, (n, n_rows))
    diagonal = sp.diags_array(scale)
    delassus = sp.csr_array(diagonal @ problem.delassus() @ diagonal)
    matrix = sp.csr_array(velocity @ delassus @ impulse + _sparse(conditions.direct, (n, n)))
    free_velocity = scale * problem.free_velocity / speed
    vector = velocity @ (delassus @ conditions.offset + free_velocity) + conditions.constant
    to_impulses = sp.csr_array(speed * diagonal @ impulse)
    return Complementarity(matrix, vector, to_impulses, speed * scale * conditions.offset)


class _Conditions:
    """Coefficients of Λ = A z + Λ₀ and w = B ξ + C z + w₀, from which M = B G A + C and q = B (G Λ₀ + c) + w₀ follow.

    Impulses are scaled, and velocities are in units of the largest free velocity.
    """

    def __init__(self, laws: Laws, friction: FloatArray, bound: FloatArray, sides: int) -> None:
        self._laws, self._friction, self._bound, self._sides = laws, friction, bound, sides
        self._first_unknown = np.append(
            0, np.cumsum(unknowns_of_laws(laws, sides))
        )  # first unknown of each law, total number
        self.offset, self.constant = np.zeros(laws.n_rows), np.zeros(self._first_unknown[-1])
        self.impulse: list[_Entries] = []
        self.velocity: list[_Entries] = []
        self.direct: list[_Entries] = []

    def add_unilateral(self) -> None:
        _, row, unknown = self._unknowns(self._laws.is_unilateral)
        self.impulse.append((row, unknown, 1.0))
        self.velocity.append((unknown, row, 1.0))

    def add_planar(self) -> None:
        law, row, distance = self._unknowns(self._laws.is_friction & (self._laws.row_count == 1))
        reverse_speed = distance + 1
        self.impulse += [(row, distance, 1.0), self._bounds(law, row, -1.0)]
        self.velocity.append((distance, row, 1.0))
        self.direct += [
            (distance, reverse_speed, 1.0),
            (reverse_speed, distance, -1.0),
            self._bounds(law, reverse_speed, 2.0),
        ]
        self.offset[row], self.constant[reverse_speed] = -self._bound[law], 2.0 * self._bound[law]

    def add_spatial(self) -> None:
        law, row, first = self._unknowns(self._laws.is_friction & (self._laws.row_count == 2))
        beta, multiplier = first[:, None] + np.arange(self._sides), first + self._sides
        for axis, coordinates in enumerate(corners(self._sides)):
            self.impulse.append((row[:, None] + axis, beta, coordinates))
            self.velocity.append((beta, row[:, None] + axis, coordinates))
        column = multiplier[:, None]
        self.direct += [(beta, column, 1.0), (column, beta, -1.0), self._bounds(law, multiplier, 1.0)]
        self.constant[multiplier] = self._bound[law]

    def _unknowns(self, is_selected: NDArray[np.bool_]) -> tuple[IntArray, IntArray, IntArray]:
        """Return the selected laws, their first rows and their first unknowns."""
        law = np.flatnonzero(is_selected)
        return law, self._laws.first_row[law], self._first_unknown[law]

    def _bounds(self, law: IntArray, row: IntArray, factor: float) -> _Entries:
        """Return the entries ``factor`` times μ in the columns of the normal impulses, for each law with μ > 0."""
        has_friction = self._friction[law] > 0.0
        law, row = law[has_friction], row[has_friction]
        return row, self._first_unknown[self._laws.partner[law]], factor * self._friction[law]


def _sparse(entries: list[_Entries], shape: tuple[int, int]) -> sp.csr_array:
    flat = [[array.ravel() for array in np.broadcast_arrays(*part)] for part in entries]
    rows, columns, values = map(np.concatenate, zip(*flat, strict=True))
    return sp.csr_array((values, (rows, columns)), shape=shape)


def _scales(problem: ContactProblem, residual: Residual) -> FloatArray:
    """Return s = 1/√α of each row, with α of its contact, or with the largest α if its contact has α = 0."""
    layout = problem.layout
    law_alpha = np.append(residual.alpha, 0.0)  # the index of a law that a block does not have is -1
    alpha = np.maximum(law_alpha[layout.normal_law], law_alpha[layout.friction_law])
    alpha = np.where(alpha > 0.0, alpha, max(float(alpha.max(initial=0.0)), np.finfo(float).tiny))
    scale: FloatArray = layout.unpad(np.repeat(1.0 / np.sqrt(alpha), layout.width))
    return scale
