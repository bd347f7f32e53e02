"""Contact laws at acceleration level, which govern the motion between two events.

A closed contact has g = 0 (index 3) and γ_N = 0 (index 2). Differentiating g twice and γ_N once gives

    γ̇ = Wᵀ u̇ + Ẇᵀ u,    u̇ = M⁻¹ (h + W λ),

an algebraic system for the forces λ (index 1). The set-valued laws keep their structure, with accelerations in place
of velocities (Glocker 2001, *Set-Valued Force Laws*, chapter 5; Pfeiffer & Glocker 1996, chapter 5):

    closed contact              −γ̇_N ∈ N_{R₀⁺}(λ_N)                     it stays closed, or opens with λ_N = 0
    with γ_T = 0                −γ̇_T ∈ N_{[−μ λ_N, μ λ_N]}(λ_T)         it continues to stick, or begins to slip
    with γ_T ≠ 0                λ_T = −μ λ_N sign(γ_T)                  it slips; no further law
    open contact                λ = 0

The laws of closed and sticking contacts form one contact problem in λ and γ̇ with G = Wᵀ M⁻¹ W and c = Wᵀ M⁻¹ h + Ẇᵀ u.
A slipping contact has only a unilateral law, whose force acts along w_N − μ sign(γ_T) w_T, so that G is not symmetric.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....arrays import FloatArray, IntArray
from ....contact.laws import LawKind, Laws
from ....contact.problem import ContactProblem
from ...bodies.system import MechanicalSystem

SINGULAR = 1e-12
"""Ratio of singular values below which constraints count as redundant; forces then have the least norm."""


@dataclass(frozen=True, eq=False)
class Modes:
    """The mode of each contact during one phase of smooth motion.

    Attributes:
        closed: whether γ_N = 0 is kept, shape (n_contacts,).
        slip: sign of γ_T of closed contacts that slip, 0 for sticking and open contacts, shape (n_contacts,).
    """

    closed: NDArray[np.bool_]
    slip: FloatArray

    def sticks(self, contact: int) -> bool:
        """Return whether a contact is closed and its tangential velocity is zero."""
        return bool(self.closed[contact] and self.slip[contact] == 0.0)


@dataclass(frozen=True, eq=False)
class Constraints:
    """The equations A x + b = γ̇ of closed contacts at one state; x are their unknown forces [N].

    Attributes:
        rows: the rows of W with an unknown force: N of closed contacts, T of those that stick, shape (m,).
        matrix: A [1/kg], shape (m, m).
        free_acceleration: b [m/s²], the accelerations without contact forces, shape (m,).
        free_motion: M⁻¹ h, in the units of u̇, shape (n_dofs,).
        responses: u̇ for a unit of each unknown force, shape (n_dofs, m).
    """

    rows: IntArray
    matrix: FloatArray
    free_acceleration: FloatArray
    free_motion: FloatArray
    responses: FloatArray


@dataclass(frozen=True, eq=False)
class AccelerationLaws:
    """The contact laws of a system at acceleration level.

    Attributes:
        system: the system, with planar friction or none.
    """

    system: MechanicalSystem

    @property
    def width(self) -> int:
        """Number of rows of a contact, 1 or 2."""
        return self.system.width

    def constraints(self, position: FloatArray, velocity: FloatArray, modes: Modes) -> Constraints:
        """Return the equations of closed contacts; the force directions of slipping contacts include their friction."""
        width, friction = self.width, np.asarray(self.system.friction)
        rows, normal = _rows(modes, width)
        directions = self.system.directions(position)
        force_directions = directions[:, rows]
        if width == 2:
            contacts = normal[normal >= 0]
            force_directions[:, normal >= 0] -= (friction * modes.slip)[contacts] * directions[:, 2 * contacts + 1]
        mass = self.system.mass(position)
        right_sides = np.column_stack([self.system.force(position, velocity), force_directions])
        accelerations: FloatArray = np.linalg.solve(mass, right_sides).astype(np.float64)
        transposed = directions[:, rows].T
        free_acceleration = transposed @ accelerations[:, 0]
        if self.system.direction_rates is not None:
            free_acceleration += self.system.direction_rates(position, velocity)[rows]
        return Constraints(
            rows, transposed @ accelerations[:, 1:], free_acceleration, accelerations[:, 0], accelerations[:, 1:]
        )

    def motion(self, position: FloatArray, velocity: FloatArray, modes: Modes) -> tuple[FloatArray, FloatArray]:
        """Return u̇ and the forces λ [N], shape (n_contacts, width), that keep the constraints of ``modes``."""
        equations = self.constraints(position, velocity, modes)
        forces = np.zeros((len(modes.closed), self.width))
        if not len(equations.rows):
            return equations.free_motion, forces
        solution = np.linalg.lstsq(equations.matrix, -equations.free_acceleration, rcond=SINGULAR)
        unknown: FloatArray = solution[0].astype(np.float64)
        forces.flat[equations.rows] = unknown
        if self.width == 2:
            forces[:, 1] -= np.asarray(self.system.friction) * modes.slip * forces[:, 0]
        return equations.free_motion + equations.responses @ unknown, forces

    def problem(self, position: FloatArray, velocity: FloatArray, candidates: Modes) -> ContactProblem:
        """Return the contact problem in λ [N] and γ̇ [m/s²]: N of closed contacts, and T of those that stick.

        Its rows are those of ``constraints``.

        Raises:
            ProblemError: if friction drives a slipping contact into penetration (Painlevé's paradox), so that G_ii < 0.
        """
        equations = self.constraints(position, velocity, candidates)
        _, normal = _rows(candidates, self.width)
        is_friction = normal < 0
        coefficient = np.where(is_friction, np.asarray(self.system.friction)[equations.rows // self.width], 0.0)
        kind = np.where(is_friction, LawKind.PLANAR_FRICTION, LawKind.UNILATERAL)
        partner = np.where(is_friction, np.arange(len(normal)) - 1, -1)
        laws = Laws.in_order(kind, coefficient, np.zeros(len(normal)), partner)
        return ContactProblem.from_delassus(
            equations.matrix, equations.free_acceleration, laws=laws, allow_asymmetric=True
        )


def _rows(modes: Modes, width: int) -> tuple[IntArray, IntArray]:
    """Return the rows with unknown forces, and for each row its contact if the row is N, else −1."""
    has_unknown_force = np.column_stack([modes.closed, modes.closed & (modes.slip == 0.0)])[:, :width]
    rows = np.flatnonzero(has_unknown_force)
    contact, lane = np.divmod(rows, width)
    return rows, np.where(lane == 0, contact, -1)


def least_change(mass: FloatArray, directions: FloatArray, violation: FloatArray) -> FloatArray:
    """Return the change Δu of least kinetic norm with Wᵀ Δu = ``violation``, shape (n_dofs,).

    Args:
        mass: M, shape (n_dofs, n_dofs).
        directions: W, shape (n_dofs, m).
        violation: the required change of Wᵀ u, shape (m,).
    """
    responses: FloatArray = np.linalg.solve(mass, directions).astype(np.float64)
    change: FloatArray = responses @ np.linalg.lstsq(directions.T @ responses, violation, rcond=SINGULAR)[0]
    return change
