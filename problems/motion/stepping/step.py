"""Steps: the one-step solve, the states of its force laws, and the step that a stepper accepts.

A law projects if its prox argument x = Λ − ξ/α lies outside its set or on the boundary, where α is the largest diagonal
entry of the block of the law in G (Studer & Glocker 2005, section 6). A unilateral law that projects is open, x_N ≤ 0.
A friction law that projects slips: ‖x_T‖ exceeds its bound b by more than ``BOUNDARY_WIDTH``. A contact that is not
active, g ≥ 0, is open, and the friction of an open contact, whose set is {0}, projects. A contact without friction,
μ = a = 0, neither sticks nor slips. A slip that reverses within one step passes through sticking, and counts as a
switch as well.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numba import njit

from ...arrays import FloatArray, IntArray
from ...contact.problem import ContactProblem
from ...contact.solver import Status
from ...errors import ProxbenchError
from ..bodies.system import ActiveContacts
from ..state import State

BOUNDARY_WIDTH = 1e-8
"""Relative width of the boundary of a friction law, within which a contact sticks. Rounding would otherwise decide the
state of a contact whose friction lies on its bound although other contacts hold its body."""

NOT_FINITE = "the motion is no longer finite"
"""Beginning of the message of a step after which positions or velocities are not finite."""

LawName = Literal["unilateral", "friction"]
"""Name of a law. Result files store indices into these names, so their order is fixed."""

LawState = Literal["open", "closed", "stick", "slip"]
"""State of a law. Result files store indices into these names, so their order is fixed."""


@dataclass(frozen=True, eq=False)
class Step:
    """One solved step.

    Attributes:
        state: the state at its end.
        problem: the contact problem that was solved, None if no contact was active.
        impulses: Λ [N s], shape (n_rows,), empty without contacts.
        contacts: the active contacts, None if there were none.
        status: status of the solver, None if there was nothing to solve.
        iterations: iterations of the solver.
        overlap: the largest penetration [m] at the end, if the projection of positions did not reach its tolerance;
            otherwise 0.
    """

    state: State
    problem: ContactProblem | None
    impulses: FloatArray
    contacts: ActiveContacts | None
    status: Status | None
    iterations: int
    overlap: float = 0.0


class StepError(ProxbenchError):
    """A motion cannot be continued.

    Attributes:
        state: the last valid state.
    """

    def __init__(self, message: str, state: State) -> None:
        super().__init__(message)
        self.state = state


def check_finite(begin: State, end: State) -> None:
    """Raise ``StepError`` unless the state at the end of a step is finite."""
    if not (are_finite(end.velocity) and are_finite(end.position)):
        raise StepError(f"{NOT_FINITE} after t = {begin.time:.9g} s.", begin)


def are_finite(numbers: FloatArray) -> bool:
    """Return whether all numbers are finite."""
    return bool(_are_finite(np.ascontiguousarray(numbers, dtype=np.float64).reshape(-1)))


@njit(cache=True, fastmath={"reassoc"}, error_model="numpy")
def _are_finite(numbers):  # type: ignore[no-untyped-def]
    """Return whether the sum of the products with 0 is 0; it is NaN if a number is not finite."""
    total = 0.0
    for k in range(len(numbers)):
        total += 0.0 * numbers[k]
    return total == 0.0


@dataclass(frozen=True)
class SwitchingPoint:
    """A switch of a law between two successive steps: it projects in exactly one of them, or its slip reverses.

    Attributes:
        begin: earliest time of the switch [s].
        end: latest time of the switch [s].
        law: the law that switches.
        contact: key of the contact.
        before: the state of the law before the switch.
        after: the state of the law after the switch; if a contact slips before and after, its slip reverses.
    """

    begin: float
    end: float
    law: LawName
    contact: int
    before: LawState
    after: LawState


@dataclass(frozen=True, eq=False)
class LawStates:
    """The states of all laws in a step. Contacts that are not listed are open.

    Attributes:
        closed: keys of closed contacts, ascending.
        sticking: keys of sticking contacts, ascending.
        slips: friction impulse Λ_T of each closed contact with friction that slips, by its key.
    """

    closed: tuple[int, ...] = ()
    sticking: tuple[int, ...] = ()
    slips: Mapping[int, tuple[float, ...]] = field(default_factory=dict)

    def is_unchanged_since(self, before: "LawStates") -> bool:
        """Return whether no law has switched since ``before``."""
        is_same = self.closed == before.closed and self.sticking == before.sticking
        return is_same and not self._reversed(before)

    def switches_since(self, before: "LawStates", begin: float, end: float) -> tuple[SwitchingPoint, ...]:
        """Return the switches since ``before``, between two times [s], by contact, the unilateral law first."""
        switches: list[SwitchingPoint] = []
        reversals = self._reversed(before)
        for key in sorted({*self.closed, *before.closed}):
            was_closed, is_closed = key in before.closed, key in self.closed
            if was_closed != is_closed:
                states: tuple[LawState, LawState] = ("closed", "open") if was_closed else ("open", "closed")
                switches.append(SwitchingPoint(begin, end, "unilateral", key, *states))
            stuck, sticks = key in before.sticking, key in self.sticking
            if stuck != sticks or key in reversals:
                states = ("stick" if stuck else "slip", "stick" if sticks else "slip")
                switches.append(SwitchingPoint(begin, end, "friction", key, *states))
        return tuple(switches)

    def _reversed(self, before: "LawStates") -> list[int]:
        """Return the keys of the contacts whose slip reverses.

        The friction impulses of one contact may differ in length, because all contacts of a step have as many
        components as the widest one; further components of a contact are 0.
        """
        pairs = [(key, friction, before.slips[key]) for key, friction in self.slips.items() if key in before.slips]
        lengths = [min(len(friction), len(previous)) for _, friction, previous in pairs]
        return [
            key
            for (key, friction, previous), n in zip(pairs, lengths, strict=True)
            if np.dot(friction[:n], previous[:n]) < 0.0
        ]


@dataclass(frozen=True, eq=False)
class AcceptedStep:
    """One step that a stepper accepts.

    Attributes:
        begin: the state at its beginning.
        end: the state at its end.
        substeps: the one-step solves from ``begin`` to ``end`` that give the result, each with its length [s].
        error: estimated relative error; 0 if it is not estimated.
        states: states of the laws in its last one-step solve; empty for a stepper that does not determine them.
        switches: its switching points.
        solves: number of one-step inclusions for it, with or without contacts, including those of rejected attempts.
        iterations: iterations of the solver in all of them; 0 for a stepper that does not count them.
        rejected: number of attempts rejected before it.
        seconds: wall time of all its attempts [s].
    """

    begin: State
    end: State
    substeps: Sequence[tuple[Step, float]]
    error: float = 0.0
    states: LawStates = LawStates()
    switches: Sequence[SwitchingPoint] = ()
    solves: int = 1
    iterations: int = 0
    rejected: int = 0
    seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class ContactLanes:
    """The contacts of a solved step, without joints, with one column for each of N, T1 and T2 that their laws use.

    Attributes:
        keys: keys of the contacts, ascending, shape (n_contacts,).
        impulses: Λ [N s], shape (n_contacts, 1, 2 or 3).
        velocity: ξ [m/s], same shape.
        diagonal: diagonal of G [1/kg], same shape.
        friction_coefficient: μ, shape (n_contacts,).
        fixed_bound: a [N s], shape (n_contacts,).
    """

    keys: IntArray
    impulses: FloatArray
    velocity: FloatArray
    diagonal: FloatArray
    friction_coefficient: FloatArray
    fixed_bound: FloatArray


def contact_lanes(problem: ContactProblem, impulses: FloatArray, contacts: ActiveContacts) -> ContactLanes:
    """Return the contacts of a step.

    Args:
        problem: the contact problem of the step.
        impulses: its solution Λ [N s], shape (n_rows,).
        contacts: the active contacts, including joints.
    """
    layout = problem.layout
    velocity = problem.relative_velocity(impulses)
    padded = [layout.pad(rows) for rows in (impulses, velocity, problem.delassus_diagonal)]
    if layout.rolling:
        padded = [values[:, : 1 + layout.sliding] for values in padded]
    bounds = [layout.friction_coefficient, layout.fixed_bound]
    keys = contacts.keys
    if contacts.row_counts is not None:  # a joint has a block for each of its rows
        keys = keys[contacts.is_contact]
        blocks = layout.contact_of_row[contacts.first_rows[contacts.is_contact]]
        padded, bounds = [values[blocks] for values in padded], [values[blocks] for values in bounds]
    return ContactLanes(keys, *padded, *bounds)


def law_states(step: Step) -> LawStates:
    """Return the states of all laws in a step."""
    if step.contacts is None or step.problem is None:
        return LawStates()
    lanes = contact_lanes(step.problem, step.impulses, step.contacts)
    keys, alpha, impulses, velocity = lanes.keys, lanes.diagonal, lanes.impulses, lanes.velocity
    stiffness = alpha[:, 1:].max(axis=1, initial=0.0)
    is_closed = impulses[:, 0] * alpha[:, 0] > velocity[:, 0]
    bound = (lanes.fixed_bound + lanes.friction_coefficient * np.maximum(impulses[:, 0], 0.0)) * stiffness
    argument = stiffness[:, None] * impulses[:, 1:] - velocity[:, 1:]
    sticks = is_closed & (bound > 0.0) & (np.linalg.norm(argument, axis=1) <= (1.0 + BOUNDARY_WIDTH) * bound)
    has_friction = (lanes.friction_coefficient > 0.0) | (lanes.fixed_bound > 0.0)
    slips = np.flatnonzero(is_closed & has_friction & ~sticks)
    friction = {int(keys[row]): tuple(impulses[row, 1:].tolist()) for row in slips}
    return LawStates(tuple(keys[is_closed].tolist()), tuple(keys[sticks].tolist()), friction)
