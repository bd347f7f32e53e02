"""One step of a variable step size through smooth motion: Moreau's rule taken n = 1, 2, … times, and extrapolated.

Between switching points the midpoint rule T_n(H), n steps of H/n, has an expansion in powers of the step, so that the
scheme of Aitken and Neville,

    T_{n,1} = T_n,      T_{n,k+1} = T_{n,k} + (T_{n,k} − T_{n−1,k}) / ((n/(n−k))^p − 1),

raises the order by p with every column (Deuflhard 1983; Hairer, Nørsett & Wanner 1993, II.9): p = 2 for a reversible
system, p = 1 otherwise. The difference of the last two columns estimates the error. Where the states of the laws differ
within the step, nothing may be extrapolated: the attempt says so.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...arrays import FloatArray
from ...errors import ProblemError
from ..bodies.system import System
from ..state import State
from .contact_states import LawStates, law_states
from .moreau import ContactSolver, Moreau, Step


@dataclass(frozen=True, eq=False)
class Attempt:
    """What came of one attempt.

    Attributes:
        end: the state at the end, None if the laws switch within the step.
        errors: estimates of the relative error with 2, 3, … columns; empty if the laws switch.
        states: states of the laws in the last step taken.
        substeps: the last sequence of steps before any switch, in order, each with its length [s].
    """

    end: State | None
    errors: list[float]
    states: LawStates
    substeps: list[tuple[Step, float]]

    @property
    def levels(self) -> int:
        """Number of sequences taken."""
        return len(self.errors) + 1


@dataclass(eq=False)
class OneStep:
    """Moreau's rule with any step size, which counts what it solves.

    Attributes:
        system: what moves.
        solver: any solver of the framework.
        stop: handed to the solver at each step.
        solves: one-step inclusions solved so far.
    """

    system: System
    solver: ContactSolver
    stop: Any
    solves: int = 0

    def take(self, state: State, length: float, held: tuple[int, ...] = ()) -> Step:
        """Take one step of ``length`` [s], in which contacts with the keys ``held`` do not rebound.

        Restitution belongs to impacts. A contact that stays closed has no relative velocity, but for a rest of its last
        impact, which ε would reverse in every step: a zigzag, that no extrapolation may continue. Solvers start from
        the last impulses, and those grow with the step: states hold the mean forces Λ/Δt of their last step in their
        place.

        Raises:
            UnsolvedStepError: if the solver does not solve the inclusion, or its impulses are not finite.
        """
        self.solves += 1
        begin = replace(state, impulses=state.impulses * length)
        step = Moreau(self.system, self.solver, self.stop, length).step(begin, held)
        if step.status is not None and str(step.status) != "solved":
            raise UnsolvedStepError(str(step.status))
        if not np.isfinite(step.impulses).all():
            raise UnsolvedStepError(f"{step.status}, but with impulses that are not finite")
        return replace(step, state=replace(step.state, impulses=step.state.impulses / length))


class UnsolvedStepError(Exception):
    """The inclusion of a step was not solved; the message is the status that the solver gives."""


@dataclass(frozen=True, eq=False)
class Acceptance:
    """When an attempt is good enough.

    Attributes:
        tolerance: relative error to reach.
        error: differences of (q, u) ↦ relative error.
        levels: most sequences to take.
    """

    tolerance: float
    error: Callable[[FloatArray], float]
    levels: int


@dataclass(frozen=True)
class Scheme(ABC):
    """How a smooth step is taken and its error estimated: by sequences of 1, 2, …, ``levels`` steps at most."""

    levels: int

    def attempt(
        self, rule: OneStep, state: State, length: float, states: LawStates | None, accept: Acceptance
    ) -> Attempt:
        """Try one step of ``length`` [s] with the laws in ``states`` (any, if None) throughout."""
        row: list[FloatArray] = []
        errors: list[float] = []
        for n in range(1, min(self.levels, accept.levels) + 1):
            sequence = take_sequence(rule, state, length, n, states)
            if sequence.end is None:
                return sequence
            states = sequence.states
            row = self.row(row, np.concatenate([sequence.end.position, sequence.end.velocity]), rule.system)
            if n > 1:
                errors.append(accept.error(row[-1] - row[-2]))
                if errors[-1] <= accept.tolerance:
                    break
        return self.ended(replace(sequence, errors=errors), row[-1], state.time + length)

    @abstractmethod
    def row(self, before: list[FloatArray], first: FloatArray, system: System) -> list[FloatArray]:
        """Return T_{n,1}, … from T_{n−1,1}, … and T_{n,1}, each (q, u); the last two differ by the error."""

    def ended(self, sequence: Attempt, last: FloatArray, time: float) -> Attempt:
        """Return the attempt whose last sequence led to T_{n,1}, and whose row ends in ``last`` at ``time`` [s]."""
        return sequence

    @abstractmethod
    def order(self, levels: int, system: System) -> int:
        """Power of the step with which the error estimate with ``levels`` sequences falls."""


@dataclass(frozen=True)
class Extrapolation(Scheme):
    """Extrapolated sequences of 1, 2, …, ``levels`` steps, as many of them as the tolerance needs.

    Attributes:
        levels: most sequences, at least 2; order 2·levels in reversible systems, else ``levels``.

    Raises:
        ProblemError: for fewer than 2 levels.
    """

    levels: int = 4

    def __post_init__(self) -> None:
        if self.levels < 2:
            raise ProblemError(f"levels must be at least 2, got {self.levels}.")

    def row(self, before: list[FloatArray], first: FloatArray, system: System) -> list[FloatArray]:
        """Return T_{n,1} … T_{n,n}."""
        power, n, row = 2 if is_reversible(system) else 1, len(before) + 1, [first]
        for k in range(1, n):
            ratio = (n / (n - k)) ** power - 1.0
            row.append(row[k - 1] + (row[k - 1] - before[k - 1]) / ratio)
        return row

    def ended(self, sequence: Attempt, last: FloatArray, time: float) -> Attempt:
        """Return the attempt with (q, u) as extrapolated; a contact must not slip the other way with them."""
        assert sequence.end is not None
        position, velocity = np.split(last, [len(sequence.end.position)])
        if _turns(sequence.substeps[-1][0], sequence.states, velocity):
            return Attempt(None, [], sequence.states, [])
        return replace(sequence, end=replace(sequence.end, time=time, position=position, velocity=velocity))

    def order(self, levels: int, system: System) -> int:
        """Power of the step with which the error estimate with ``levels`` sequences falls."""
        return 2 * levels - 1 if is_reversible(system) else levels


@dataclass(frozen=True)
class StepDoubling(Scheme):
    """One step against two halves, whose difference is the error; the halves are kept as they are."""

    levels: int = field(default=2, init=False)

    def row(self, before: list[FloatArray], first: FloatArray, system: System) -> list[FloatArray]:
        """Return T_{n−1} and T_n."""
        return [*before[-1:], first]

    def order(self, levels: int, system: System) -> int:
        """Power of the step with which the error estimate falls."""
        return 3 if is_reversible(system) else 2


def _turns(step: Step, states: LawStates, velocity: FloatArray) -> bool:
    """Whether a contact that slips in ``step`` would slip the other way with the extrapolated ``velocity``."""
    if step.contacts is None or not states.slips:
        return False
    width = step.contacts.rows_per_contact
    sliding = step.contacts.directions.transposed_times(velocity).reshape(-1, width)
    rows = np.searchsorted(step.contacts.keys, list(states.slips))
    against = np.einsum("ij,ij->i", sliding[rows, 1:], list(states.slips.values()))
    return bool((against > 0.0).any())


def is_reversible(system: System) -> bool:
    """Whether a system says that its motion is the same backwards, see ``MechanicalSystem``."""
    return bool(getattr(system, "is_reversible", False))


def take_sequence(rule: OneStep, state: State, length: float, count: int, states: LawStates | None) -> Attempt:
    """Take ``count`` steps that make up ``length``; stop at the first whose laws are not in ``states``."""
    substeps: list[tuple[Step, float]] = []
    part = length / count
    for _ in range(count):
        step = rule.take(state, part, () if states is None else states.closed)
        found = law_states(step)
        if states is not None and not found.continues(states):
            return Attempt(None, [], found, substeps)
        states, state = found, step.state
        substeps.append((step, part))
    assert states is not None
    return Attempt(state, [], states, substeps)
