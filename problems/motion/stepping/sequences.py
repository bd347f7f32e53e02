"""Sequences of n = 1, 2, … equal midpoint steps over one interval, which an error estimate compares.

If the states of the laws change within the interval, sequences are not comparable, and the sequence ends there.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...contact.solver import Status, Stop
from ..bodies.system import System
from ..state import State
from .midpoint import ContactSolver, MidpointRule
from .step import LawStates, Step, law_states


class UnsolvedStepError(Exception):
    """The inclusion of a step was not solved; the message is the status that the solver reports."""


@dataclass(eq=False)
class StepCounter:
    """A counter that takes midpoint steps of any length.

    Attributes:
        system: the mechanical system.
        solver: solves the contact problem of each step.
        stop: the stopping criterion of each solve.
        solves: number of one-step inclusions so far, with or without contacts.
        iterations: iterations of the solver in all of them.
    """

    system: System
    solver: ContactSolver
    stop: Stop
    solves: int = 0
    iterations: int = 0

    def take(self, state: State, length: float, inelastic: tuple[int, ...] = ()) -> Step:
        """Take one step of ``length`` [s] in which contacts with the keys ``inelastic`` do not rebound.

        Restitution belongs to impacts. A contact that stays closed has no relative velocity, except for a remainder of
        its last impact. With ε > 0, each step would reverse this remainder, and extrapolation would fail. Solvers start
        from the last impulses. These are proportional to the step, so states store the mean forces Λ/Δt of the last
        step instead.

        Raises:
            UnsolvedStepError: if the solver does not solve the inclusion, or its impulses are not finite.
        """
        self.solves += 1
        begin = replace(state, impulses=state.impulses * length)
        step = MidpointRule(self.system, self.solver, self.stop, length).step(begin, inelastic)
        self.iterations += step.iterations
        if step.status not in (None, Status.SOLVED):
            raise UnsolvedStepError(str(step.status))
        if not np.isfinite(step.impulses).all():
            raise UnsolvedStepError(f"{step.status}, but with impulses that are not finite")
        return replace(step, state=replace(step.state, impulses=step.state.impulses / length))


@dataclass(frozen=True, eq=False)
class Attempt:
    """The outcome of an attempted step.

    Attributes:
        end: the state at the end, None if the laws switch within the step.
        errors: estimates of the relative error with 2, 3, … sequences; empty if the laws switch.
        states: states of the laws in the last step.
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


def take_sequence(counter: StepCounter, state: State, length: float, count: int, states: LawStates | None) -> Attempt:
    """Take ``count`` steps that make up ``length`` [s]; stop at the first step whose laws leave ``states``."""
    substeps: list[tuple[Step, float]] = []
    part_length = length / count
    for _ in range(count):
        step = counter.take(state, part_length, () if states is None else states.closed)
        new_states = law_states(step)
        if states is not None and not new_states.is_unchanged_since(states):
            return Attempt(None, [], new_states, substeps)
        states, state = new_states, step.state
        substeps.append((step, part_length))
    assert states is not None
    return Attempt(state, [], states, substeps)


def is_reversible(system: System) -> bool:
    """Return whether a system declares that its motion is reversible; see ``MechanicalSystem``."""
    return bool(getattr(system, "is_reversible", False))
