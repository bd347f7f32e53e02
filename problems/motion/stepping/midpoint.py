"""Moreau's midpoint rule, one step of any length (Studer & Glocker 2005, section 3.4, [27, 31–33]).

From t_B to t_E = t_B + Δt:

    q_M = q_B + u_B Δt/2
    G = Wᵀ M⁻¹ W,   c = (I + ε) Wᵀ u_B + Wᵀ M⁻¹ h Δt − χ   at q_M, for the contacts with g(q_M) < 0
    −(G Λ + c)_i ∈ N_{C_i}(Λ_i)                             solved by any solver
    u_E = u_B + M⁻¹ (h Δt + W Λ),   q_E = q_M + u_E Δt/2

χ is the target speed of motors. Forces h that depend on the velocity are taken at u_B, except gyroscopic moments. With
these, the step is solved twice: with h of the free motion, and then with h at the velocity (u_B + u_E)/2 of the first
solution. The error of Λ is O(Δt²) in the first solution, and that of u_E is O(Δt³) in the second. The order is
therefore 2 for rotating bodies with joints.

Optionally, a projection at q_E moves penetrating bodies apart to an allowed depth and closes joints (see
``position_projection``).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numba import njit, uint64

from ...arrays import FloatArray
from ...contact.matrices.factors import Factors
from ...contact.matrices.pieces import Pieces
from ...contact.problem import ContactProblem
from ...contact.solver import Prepared, Stop
from ...errors import ProblemError, error_text
from ..bodies.system import ActiveContacts, StepAssembly, System
from ..state import State
from .position_projection import Projection, projected
from .step import Step, StepError, are_finite, check_finite


class ContactSolver(Protocol):
    """The part of the ``Solver`` interface that steppers use."""

    def prepare(self, problem: ContactProblem) -> Prepared:
        """Return the solver prepared for ``problem``."""
        ...


@dataclass(frozen=True)
class MidpointRule:
    """The midpoint rule.

    Attributes:
        system: the mechanical system.
        solver: solves the contact problem of each step.
        stop: the stopping criterion of each solve.
        time_step: Δt [s], positive.
        warm_start: whether each solve starts from the last step's impulses, contact by contact.
        depth: penetration [m] beyond which bodies are moved apart at the end of a step (see ``position_projection``);
            if None, a penetration lasts as long as its contact.

    Raises:
        ProblemError: if Δt or the depth is not positive.
    """

    system: System
    solver: ContactSolver
    stop: Stop
    time_step: float
    warm_start: bool = True
    depth: float | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.time_step < np.inf:
            raise ProblemError(f"time_step must be positive, got {self.time_step}.")
        if self.depth is not None and not 0.0 < self.depth < np.inf:
            raise ProblemError(f"depth must be positive, got {self.depth}.")

    def step(self, state: State, inelastic: tuple[int, ...] = ()) -> Step:
        """Take one step in which the contacts with the keys ``inelastic`` do not rebound."""
        half = 0.5 * self.time_step
        midpoint = self.system.move(state.position, state.velocity, half)
        assembly = self.system.assemble(midpoint, state.velocity, self.time_step)
        contacts = assembly.contacts
        time = state.time + self.time_step
        if contacts is None:
            velocity = assembly.free_motion
            end = self._end(midpoint, velocity)
            state = State(time, end.position, end.velocity)
            return Step(state, None, np.zeros(0), None, None, 0, end.overlap)
        if inelastic:
            contacts = _without_rebound(contacts, inelastic)
        problem = step_problem(assembly, contacts, state.velocity)
        start = _matched_impulses(state, contacts) if self.warm_start else None
        solution = self.solver.prepare(problem).solve(self.stop, start)
        iterations = solution.iterations
        if assembly.free_motion_with is not None:
            free_motion = assembly.free_motion_with(contacts.times(solution.impulses))
            assembly = replace(assembly, free_motion=free_motion)
            problem = step_problem(assembly, contacts, state.velocity)
            start = solution.impulses if self.warm_start else None
            solution = self.solver.prepare(problem).solve(self.stop, start)
            iterations += solution.iterations
        velocity = assembly.free_motion + assembly.inverse_mass.times(contacts.times(solution.impulses))
        end = self._end(midpoint, velocity)
        state = State(time, end.position, end.velocity, contacts.keys, contacts.lanes(solution.impulses))
        return Step(state, problem, solution.impulses, contacts, solution.status, iterations, end.overlap)

    def _end(self, midpoint: FloatArray, velocity: FloatArray) -> Projection:
        """Return q_E and u_E, projected if a depth is given."""
        position = self.system.move(midpoint, velocity, 0.5 * self.time_step)
        if self.depth is None or not are_finite(position):  # callers report a motion that is not finite
            return Projection(position, velocity)
        return projected(self.system, position, velocity, self.depth)

    def steps(self, state: State, count: int) -> Iterator[Step]:
        """Yield ``count`` successive steps from ``state``.

        Raises:
            StepError: if the system or the solver fails in a step, or the motion is no longer finite.
        """
        for _ in range(count):
            try:
                step = self.step(state)
            except (Exception, SystemExit) as failure:
                message = f"a step of {self.time_step:.3g} s from t = {state.time:.9g} s failed: {error_text(failure)}."
                raise StepError(message, state) from failure
            check_finite(state, step.state)
            state = step.state
            yield step


def step_problem(assembly: StepAssembly, contacts: ActiveContacts, velocity: FloatArray) -> ContactProblem:
    """Return the contact problem of one step in factor form, c = Wᵀ(u_B + M⁻¹hΔt) + ε Wᵀu_B − χ."""
    directions = contacts.directions
    if isinstance(directions, Pieces):
        free_velocity = directions.free_velocity(assembly.free_motion, velocity, contacts.restitution)
    else:
        transposed = directions.T
        free_velocity = transposed @ assembly.free_motion + contacts.restitution * (transposed @ velocity)
    if contacts.drive is not None:
        free_velocity -= contacts.drive
    factors = Factors(directions, assembly.inverse_mass, assembly.free_motion)
    return ContactProblem(free_velocity, contacts.laws, factors=factors)


def _without_rebound(contacts: ActiveContacts, inelastic: tuple[int, ...]) -> ActiveContacts:
    """Return the contacts with ε = 0 for the keys ``inelastic``."""
    is_inelastic = contacts.for_rows(np.isin(contacts.keys, inelastic))
    return replace(contacts, restitution=np.where(is_inelastic, 0.0, contacts.restitution))


def _matched_impulses(state: State, contacts: ActiveContacts) -> FloatArray:
    """Return the last impulses of contacts that persist, and zero for new contacts, shape (n_rows,)."""
    start = np.zeros((len(contacts.keys), contacts.width))
    if state.impulses.shape[1] == contacts.width:
        _copy_matching(state.keys, state.impulses, contacts.keys, start)
    return contacts.rows(start)


@njit(cache=True)
def _copy_matching(old_keys, old_rows, keys, rows):  # type: ignore[no-untyped-def]
    """Copy the rows of keys that occur in both ascending lists."""
    old, width = uint64(0), uint64(rows.shape[1])
    for new in range(uint64(len(keys))):
        key = keys[new]
        while old < len(old_keys) and old_keys[old] < key:
            old += uint64(1)
        if old < len(old_keys) and old_keys[old] == key:
            for lane in range(width):
                rows[new, lane] = old_rows[old, lane]
