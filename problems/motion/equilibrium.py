"""Equilibrium at rest: a test of whether some Λ within the laws balances the forces, h + W Λ = 0.

By Gauss's principle of least constraint, find the Λ with the least acceleration,

    minimise ‖h + W Λ‖_{M⁻¹}  over  Λ ∈ K,      K = {Λ_N ≥ 0, ‖Λ_T‖ ≤ a + μ Λ_N} per contact, Λ free in joints.

The bodies can stand iff the minimum is 0. Otherwise the remaining acceleration u = M⁻¹ (h + W Λ) is a mechanism
and proves that no Λ balances the loads: these do work on it, hᵀu > 0, and contacts and joints absorb no work, Wᵀu ∈ K*,
or too little if friction has a fixed bound a. Limit analysis calls u the collapse mechanism of the associated model.

Rest requires only that Λ lies in K, so "cannot stand" is exact for Coulomb friction. "Can stand" means that rest is
one motion that the laws allow. Rest may be unstable. Unless the mechanism consists of hinges, other motions may also
be possible, since a sliding contact opens in the associated model, but not with Coulomb's law.

A second program computes the largest additional push M b before collapse,

    maximise s  over  Λ ∈ K and s,  subject to  h + s M b + W Λ = 0.

Both are second-order cone programs, solved by Clarabel in units of energy: no result depends on the units of mass and
length. Impulses are those of one second, so that Λ contains forces in newtons.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import clarabel
import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from ..arrays import FloatArray, IntArray
from ..contact.laws import BALL, Laws
from ..contact.matrices.factors import Factors
from ..contact.problem import ContactProblem
from ..contact.projections import project
from ..errors import ProblemError
from .bodies.system import System
from .state import State
from .stepping.midpoint import step_problem

TOLERANCE = 1e-7
"""Largest acceleration, relative to that without contacts, at which forces count as balanced."""

SOLVER_ACCURACY = 1e-10
"""Tolerance of the cone programs, relative to the loads."""

MAX_ITERATIONS = 200
"""Limit of interior point iterations; Clarabel needs 10 to 30."""

MAX_FRICTION = 1e3
"""Largest friction coefficient that ``least_friction`` tries."""

FRICTION_ACCURACY = 1e-7
"""Width of the last bracket of ``least_friction``, relative to the upper end of the first one."""


@runtime_checkable
class HasMargin(Protocol):
    """A system that can count contacts as closed while their gap is below a margin."""

    def with_margin(self, margin: float) -> System:
        """Return the system with contacts closed at gaps below ``margin`` [m]."""
        ...


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """The result of a test of whether bodies can stand.

    Attributes:
        imbalance: ‖h + W Λ‖/‖h‖ in the norm of M⁻¹: the least acceleration relative to that without contacts, 0 for
            bodies that can stand, 1 for bodies that fall freely.
        forces: Λ [N], shape (n_rows,); if contacts are redundant, one of many distributions of the load.
        mechanism: u = M⁻¹ (h + W Λ) [m/s²], shape (n_dofs,), the acceleration from rest of the associated model; zero
            for bodies that can stand.
    """

    imbalance: float
    forces: FloatArray
    mechanism: FloatArray

    @property
    def can_stand(self) -> bool:
        """Whether the forces balance to ``TOLERANCE``."""
        return self.imbalance <= TOLERANCE


@dataclass(frozen=True, eq=False)
class Collapse:
    """The largest push that bodies at rest withstand.

    Attributes:
        factor: s, the push relative to the loads; 0 for bodies that cannot stand without it, inf if no push moves them.
        forces: Λ [N] under this push, shape (n_rows,); NaN if the push is infinite.
        mechanism: velocity u of the collapse, up to a factor, shape (n_dofs,); NaN if the push is infinite.
    """

    factor: float
    forces: FloatArray
    mechanism: FloatArray


def problem_at_rest(system: System, state: State, margin: float = 0.0) -> ContactProblem:
    """Return the contact problem of one second from rest, whose impulses [N s] are the forces [N] at rest.

    Args:
        system: the bodies.
        state: the positions of the bodies; velocities count as zero.
        margin: gap [m] below which contacts count as closed.

    Raises:
        ProblemError: if the margin is negative, or the system does not support one.
    """
    if not 0.0 <= margin < np.inf:
        raise ProblemError(f"`margin` must be a length of at least 0, got {margin}.")
    if margin > 0.0:
        if not isinstance(system, HasMargin):
            raise ProblemError(f"{type(system).__name__} does not support a margin; omit `margin`.")
        system = system.with_margin(margin)
    rest = np.zeros_like(state.velocity)
    assembly = system.assemble(state.position, rest, 1.0)
    if assembly.contacts is not None:
        return step_problem(assembly, assembly.contacts, rest)
    factors = Factors.create(sp.csc_array((len(rest), 0)), assembly.inverse_mass, assembly.free_motion)
    return ContactProblem(np.zeros(0), Laws.joints(0), factors=factors)


def find_equilibrium(problem: ContactProblem) -> Equilibrium:
    """Find forces within the laws that balance the loads, or a mechanism that proves that there are none.

    Args:
        problem: one step from rest with its factors and free motion, as returned by ``problem_at_rest``.

    Raises:
        ProblemError: if the factors or the free motion are missing, or the cone program fails.
    """
    return _least_acceleration(_ScaledProblem(problem))


def largest_push(problem: ContactProblem, direction: FloatArray) -> Collapse:
    """Return the largest push that bodies at rest withstand in addition to their loads.

    A push is a field of forces M b, for example a fraction of the weight in a horizontal direction; tilting or
    accelerating the ground has the same effect. Its size is relative to the loads, both in the norm of M⁻¹.

    Args:
        problem: see ``find_equilibrium``.
        direction: b, the acceleration of free bodies by the push, of any size, shape (n_dofs,).

    Raises:
        ProblemError: as ``find_equilibrium``, or if b has a wrong shape, is zero or is not finite.
    """
    scaled = _ScaledProblem(problem)
    b, n_rows, n_dofs = np.asarray(direction, dtype=np.float64), len(scaled.unit), len(scaled.load)
    if b.shape != scaled.load.shape or not np.isfinite(b).all() or not b.any():
        raise ProblemError(f"the direction of a push must be {n_dofs} finite numbers, not all zero.")
    equilibrium = _least_acceleration(scaled)
    if not equilibrium.can_stand:
        return Collapse(0.0, equilibrium.forces, equilibrium.mechanism)
    push = scaled.unrooted(b)
    push /= np.linalg.norm(push)
    # the unbalanced loads are subtracted, so that s = 0 is exactly feasible
    unbalanced = scaled.unbalanced(equilibrium.forces)
    balance = sp.hstack([-scaled.directions, -sp.csc_array(push[:, None])])
    solution = scaled.solve(
        np.append(np.zeros(n_rows), -1.0), balance, scaled.load - unbalanced, clarabel.ZeroConeT(n_dofs)
    )
    if solution.status in _UNBOUNDED:
        return Collapse(np.inf, np.full(n_rows, np.nan), np.full(n_dofs, np.nan))
    _require_solved(solution)
    forces = scaled.forces(np.array(solution.x)[:n_rows])
    return Collapse(max(float(solution.x[n_rows]), 0.0), forces, scaled.velocity(np.array(solution.z)[:n_dofs]))


def least_friction(problem: ContactProblem) -> float:
    """Return the least friction coefficient, equal at all contacts, with which bodies can stand.

    Returns:
        μ, found by bisection to ``FRICTION_ACCURACY``; inf if the bodies cannot stand with ``MAX_FRICTION``.

    Raises:
        ProblemError: as ``find_equilibrium``, or if no contact has friction.
    """
    if not _slides(problem.laws).any():
        raise ProblemError("no contact has friction; give the scene friction, of any coefficient.")

    def stands(friction: float) -> bool:
        return find_equilibrium(with_friction(problem, friction)).can_stand

    if stands(0.0):
        return 0.0
    low, high = 0.0, 1.0
    while not stands(high):
        if high >= MAX_FRICTION:
            return np.inf
        low, high = high, min(4.0 * high, MAX_FRICTION)
    return bisect(stands, low, high, FRICTION_ACCURACY * high)


def bisect(holds: Callable[[float], bool], low: float, high: float, accuracy: float) -> float:
    """Return the point where a condition begins to hold, the upper end of a bracket of width ``accuracy``.

    Args:
        holds: the condition, false at ``low`` and true at ``high``.
        low: lower end of the bracket.
        high: upper end of the bracket.
        accuracy: final width of the bracket.
    """
    while high - low > accuracy:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


def with_friction(problem: ContactProblem, friction: float) -> ContactProblem:
    """Return the problem with the coefficient ``friction`` at all contacts that have sliding friction."""
    laws = problem.laws
    coefficient = np.where(_slides(laws), friction, laws.friction_coefficient)
    return replace(problem, laws=replace(laws, friction_coefficient=coefficient))


def _slides(laws: Laws) -> Any:
    """Return whether each law is the Coulomb friction of a contact, shape (n_laws,)."""
    return laws.is_friction & ~laws.is_rolling & (laws.partner >= 0)


class _ScaledProblem:
    """A problem at rest in units of energy: y is Λ divided by ``unit``, and loads are multiplied by Sᵀ, M⁻¹ = S Sᵀ.

    Attributes:
        problem: the problem.
        size: ‖h‖ in the norm of M⁻¹ [√J/s], 1 without loads.
        load: S⁻¹ M⁻¹ h / size, shape (n_dofs,), of norm 1, or zero.
        unit: force [N] of each row at which y is 1, shape (n_rows,).
        directions: Sᵀ W in these units, shape (n_dofs, n_rows).
    """

    def __init__(self, problem: ContactProblem) -> None:
        if problem.factors is None or problem.factors.free_motion is None:
            raise ProblemError(
                f"{problem.name!r} lacks the factors W and M⁻¹ or the free motion, which an equilibrium needs."
            )
        self.problem, self._factors = problem, problem.factors
        load = self.unrooted(problem.factors.free_motion)
        self.size = float(np.linalg.norm(load)) or 1.0
        self.load: FloatArray = load / self.size
        laws = problem.laws
        curvature = np.maximum.reduceat(problem.delassus_diagonal, laws.first_row) if laws.n_laws else np.zeros(0)
        curvature = np.where(curvature > 0.0, curvature, curvature.max(initial=0.0) or 1.0)
        self._law_unit: FloatArray = self.size / np.sqrt(curvature)
        self.unit: FloatArray = np.repeat(self._law_unit, laws.row_count)
        self.directions = self._factors.scaled_directions @ sp.diags_array(self.unit / self.size)

    def unrooted(self, velocity: FloatArray) -> FloatArray:
        """Return S⁻¹ u for a velocity or acceleration u."""
        inverse = self._factors.inverse_mass
        unrooted: FloatArray
        unrooted = velocity / inverse.root_diagonal if inverse.is_diagonal else spsolve(inverse.root.tocsc(), velocity)
        return unrooted

    def velocity(self, dual: FloatArray) -> FloatArray:
        """Return the velocity −S z of a dual variable z of the balance of forces."""
        return self._factors.inverse_mass.root_times(-dual)

    def forces(self, y: FloatArray) -> FloatArray:
        """Return Λ [N] of y, projected onto the laws to correct errors of the solver."""
        return project(self.problem.laws, self.unit * y)

    def unbalanced(self, forces: FloatArray) -> FloatArray:
        """Return the unbalanced loads, Sᵀ (h + W Λ) / size, shape (n_dofs,)."""
        unbalanced: FloatArray = self.load + self.directions @ (forces / self.unit)
        return unbalanced

    def solve(self, objective: FloatArray, balance: Any, offset: FloatArray, cone: Any) -> Any:
        """Minimise objective · x over x = (y, one further variable), with offset − balance x in ``cone`` and y in K."""
        constraints, offsets, cones = self._cones()
        extended = sp.hstack([constraints, sp.csc_array((constraints.shape[0], 1))])
        matrix = sp.csc_matrix(sp.vstack([balance, extended]))
        settings = clarabel.DefaultSettings()
        settings.verbose, settings.max_threads, settings.max_iter = False, 1, MAX_ITERATIONS
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = SOLVER_ACCURACY
        no_quadratic_term = sp.csc_matrix((len(objective), len(objective)))
        bounds = np.concatenate([offset, offsets])
        return clarabel.DefaultSolver(no_quadratic_term, objective, matrix, bounds, [cone, *cones], settings).solve()

    def _cones(self) -> tuple[Any, FloatArray, list[Any]]:
        """Return A, b and cones with b − A y in the cones iff Λ ∈ K; each friction law has a second-order cone."""
        laws, unit = self.problem.laws, self._law_unit
        coefficient, fixed_bound = laws.friction_coefficient * unit[laws.partner] / unit, laws.fixed_bound / unit
        is_friction, has_bound = laws.sets == BALL, (coefficient > 0.0) | (fixed_bound > 0.0)
        normals, frozen = np.flatnonzero(laws.is_unilateral), np.flatnonzero(is_friction & ~has_bound)
        balls = np.flatnonzero(is_friction & has_bound)
        normal_rows, zero_rows, ball_rows = (_rows_of(laws, indices) for indices in (normals, frozen, balls))
        n_plain, lengths = len(normal_rows) + len(zero_rows), 1 + laws.row_count[balls]
        tops = n_plain + np.cumsum(lengths) - lengths
        n_constraints = n_plain + int(lengths.sum())
        members = np.setdiff1d(np.arange(n_plain, n_constraints), tops)
        rows = np.concatenate([np.arange(n_plain), members, tops])
        columns = np.concatenate([normal_rows, zero_rows, ball_rows, laws.first_row[laws.partner[balls]]])
        values = np.concatenate([np.full(n_plain + len(members), -1.0), -coefficient[balls]])
        offsets = np.zeros(n_constraints)
        offsets[tops] = fixed_bound[balls]
        cones = [clarabel.NonnegativeConeT(len(normal_rows))] if len(normal_rows) else []
        cones += [clarabel.ZeroConeT(len(zero_rows))] if len(zero_rows) else []
        cones += [clarabel.SecondOrderConeT(length) for length in lengths.tolist()]
        return sp.csc_array((values, (rows, columns)), shape=(n_constraints, len(self.unit))), offsets, cones


def _rows_of(laws: Laws, law_indices: IntArray) -> IntArray:
    """Return the rows of the laws with the indices ``law_indices``, law by law."""
    counts = laws.row_count[law_indices]
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    rows: IntArray = np.repeat(laws.first_row[law_indices], counts) + within
    return rows


def _least_acceleration(scaled: _ScaledProblem) -> Equilibrium:
    """Minimise r with (r, h + W Λ) in a second-order cone."""
    n_rows, n_dofs = len(scaled.unit), len(scaled.load)
    if not n_rows or not scaled.load.any():
        forces, mechanism = np.zeros(n_rows), scaled.velocity(-scaled.size * scaled.load)
        return Equilibrium(float(scaled.load.any()), forces, mechanism)
    top = sp.csc_array(([-1.0], ([0], [n_rows])), shape=(1, n_rows + 1))
    balance = sp.vstack([top, sp.hstack([-scaled.directions, sp.csc_array((n_dofs, 1))])])
    offset = np.append(0.0, scaled.load)
    solution = scaled.solve(np.append(np.zeros(n_rows), 1.0), balance, offset, clarabel.SecondOrderConeT(1 + n_dofs))
    _require_solved(solution)
    forces = scaled.forces(np.array(solution.x)[:n_rows])
    imbalance = float(np.linalg.norm(scaled.unbalanced(forces)))
    if imbalance <= TOLERANCE:
        return Equilibrium(imbalance, forces, np.zeros(n_dofs))
    return Equilibrium(
        imbalance, forces, scaled.velocity(imbalance * scaled.size * np.array(solution.z)[1 : 1 + n_dofs])
    )


_SOLVED = {clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved}

_UNBOUNDED = {clarabel.SolverStatus.DualInfeasible, clarabel.SolverStatus.AlmostDualInfeasible}


def _require_solved(solution: Any) -> None:
    if solution.status not in _SOLVED:
        raise ProblemError(f"the cone program of the equilibrium failed ({solution.status}).")
