"""Contact problems as linear complementarity problems: find z ≥ 0 with w = M z + q ≥ 0 and zᵀw = 0.

Each law contributes unknowns and conditions; b = a + μ Λ_N is the friction bound.

* Unilateral contact: z = Λ_N, w = ξ_N.
* Planar friction, exactly (Glocker & Studer 2005): the distances to both bounds and both parts of the velocity,

      z = (Λ_T + b, ξ⁻),    w = (ξ⁺, b − Λ_T),    ξ_T = ξ⁺ − ξ⁻.

* Spatial friction with the disc replaced by the inscribed k-gon (Stewart & Trinkle 1996): Λ_T = D β with the corners of
  the unit k-gon in the columns of D,

      z = (β, λ),    w = (Dᵀξ_T + λ e, b − eᵀβ).

Everything is scaled contact by contact: with s = 1/√α of a contact, Λ = s z and w = s ξ, which symmetrises mass ratios.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ...problems.arrays import FloatArray, IntArray
from ...problems.contact.judge import Residual
from ...problems.contact.laws import LawKind
from ...problems.contact.problem import ContactProblem
from ..interface import SolverError


@dataclass(frozen=True, eq=False)
class Complementarity:
    """A linear complementarity problem, and the way back to impulses.

    Attributes:
        matrix: M, sparse, shape (n, n).
        vector: q, shape (n,).
        back: Λ = back @ z + offset [N s], sparse, shape (n_rows, n).
        offset: the constant part of Λ [N s], shape (n_rows,).
    """

    matrix: sp.csr_array
    vector: FloatArray
    back: sp.csr_array
    offset: FloatArray

    def impulses(self, unknowns: FloatArray) -> FloatArray:
        """Return Λ [N s], shape (n_rows,), of z, shape (n,)."""
        found: FloatArray = self.back @ unknowns + self.offset
        return found


def check_sides(sides: int) -> None:
    """Raise ``SolverError`` unless ``sides`` is the number of sides of a polygon."""
    if not isinstance(sides, int) or sides < 3:
        raise SolverError(
            f"sides must be a whole number of at least 3, the sides of a friction pyramid; got {sides!r}."
        )


def corners(sides: int) -> FloatArray:
    """Return the corners of the regular polygon in the unit circle, the first on the T1 axis, shape (2, sides)."""
    angle = 2.0 * np.pi / sides * np.arange(sides)
    return np.stack([np.cos(angle), np.sin(angle)])


def complementarity(problem: ContactProblem, residual: Residual, sides: int) -> Complementarity:
    """Return the linear complementarity problem of ``problem`` with friction pyramids of ``sides`` sides.

    Args:
        problem: the contact problem.
        residual: its judge, which knows α of each law.
        sides: k of the pyramids; planar friction is exact whatever it is.
    """
    laws, n_rows = problem.laws, problem.n_rows
    unknowns_of_kind = np.array([1, 2, sides + 1])
    first = np.concatenate([[0], np.cumsum(unknowns_of_kind[laws.kind])])
    entries = _Entries(n_rows, int(first[-1]))
    scale = _scales(problem, residual)
    of_law = scale[laws.first_row]
    friction = laws.friction_coefficient * np.where(laws.partner >= 0, of_law[laws.partner], 0.0) / of_law
    bound = laws.fixed_bound / of_law / residual.scale if residual.scale else laws.fixed_bound
    normal = first[laws.partner]
    polygon = corners(sides)
    entries.unilateral(laws.first_row[laws.kind == LawKind.UNILATERAL], first[:-1][laws.kind == LawKind.UNILATERAL])
    for law in np.flatnonzero(laws.kind == LawKind.PLANAR_FRICTION):
        entries.planar(laws.first_row[law], first[law], normal[law], friction[law], bound[law])
    for law in np.flatnonzero(laws.kind == LawKind.SPATIAL_FRICTION):
        entries.spatial(laws.first_row[law], first[law], normal[law], friction[law], bound[law], polygon)
    return entries.assembled(problem, scale, residual.scale or 1.0)


class _Entries:
    """Collects Λ = A z + Λ₀ and w = B ξ + C z + w₀ law by law, in scaled units."""

    def __init__(self, n_rows: int, n_unknowns: int) -> None:
        self._shape = (n_rows, n_unknowns)
        self._impulse: list[tuple[int, int, float]] = []
        self._velocity: list[tuple[int, int, float]] = []
        self._direct: list[tuple[int, int, float]] = []
        self._offset = np.zeros(n_rows)
        self._constant = np.zeros(n_unknowns)

    def unilateral(self, rows: IntArray, unknowns: IntArray) -> None:
        for row, unknown in zip(rows.tolist(), unknowns.tolist(), strict=True):
            self._impulse.append((row, unknown, 1.0))
            self._velocity.append((unknown, row, 1.0))

    def planar(self, row: int, upper: int, normal: int, friction: float, bound: float) -> None:
        """Unknowns: ``upper`` is Λ_T + b, and the next one ξ⁻."""
        back = upper + 1
        self._impulse.append((row, upper, 1.0))
        self._offset[row] = -bound
        self._velocity.append((upper, row, 1.0))
        self._direct += [(upper, back, 1.0), (back, upper, -1.0)]
        self._constant[back] = 2.0 * bound
        if friction > 0.0:
            self._impulse.append((row, normal, -friction))
            self._direct.append((back, normal, 2.0 * friction))

    def spatial(self, row: int, first: int, normal: int, friction: float, bound: float, polygon: FloatArray) -> None:
        """Unknowns: β from ``first`` on, and λ after them."""
        sides = polygon.shape[1]
        speed = first + sides
        for corner in range(sides):
            for axis in range(2):
                self._impulse.append((row + axis, first + corner, polygon[axis, corner]))
                self._velocity.append((first + corner, row + axis, polygon[axis, corner]))
            self._direct += [(first + corner, speed, 1.0), (speed, first + corner, -1.0)]
        self._constant[speed] = bound
        if friction > 0.0:
            self._direct.append((speed, normal, friction))

    def assembled(self, problem: ContactProblem, scale: FloatArray, speed: float) -> Complementarity:
        """Return M = B S G S A + C and q = B S (G S Λ₀ + c) + w₀ with velocities in units of ``speed``."""
        n_rows, n = self._shape
        impulse, velocity = _sparse(self._impulse, (n_rows, n)), _sparse(self._velocity, (n, n_rows))
        diagonal = sp.diags_array(scale)
        delassus = sp.csr_array(diagonal @ problem.delassus() @ diagonal)
        matrix = sp.csr_array(velocity @ delassus @ impulse + _sparse(self._direct, (n, n)))
        free = scale * problem.free_velocity / speed
        vector = velocity @ (delassus @ self._offset + free) + self._constant
        back = sp.csr_array(speed * diagonal @ impulse)
        return Complementarity(matrix, vector, back, speed * scale * self._offset)


def _scales(problem: ContactProblem, residual: Residual) -> FloatArray:
    """Return s = 1/√α of each row, α the largest of its contact; 1 over the largest √α where a contact has α = 0."""
    layout = problem.layout
    with_none = np.append(residual.alpha, 0.0)
    alpha = np.maximum(with_none[layout.normal_law], with_none[layout.friction_law])
    alpha = np.where(alpha > 0.0, alpha, max(float(alpha.max(initial=0.0)), np.finfo(float).tiny))
    scale: FloatArray = layout.unpad(np.repeat(1.0 / np.sqrt(alpha), layout.width))
    return scale


def _sparse(entries: list[tuple[int, int, float]], shape: tuple[int, int]) -> sp.csr_array:
    if not entries:
        return sp.csr_array(shape, dtype=np.float64)
    rows, columns, values = zip(*entries, strict=True)
    return sp.csr_array((np.array(values), (np.array(rows), np.array(columns))), shape=shape)
