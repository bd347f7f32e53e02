"""Motions of an event-driven integrator: smooth phases, the events between them, and why a motion may end early."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....arrays import FloatArray
from ....errors import ProxbenchError
from ...state import State
from ..step import LawName, LawState


@dataclass(frozen=True, eq=False)
class Event:
    """A contact that changes its state; an impact that a contact leaves at once is two events at the same time.

    Attributes:
        time: t [s].
        law: which of its laws changes.
        contact: index of the contact.
        before: its state before.
        after: its state after.
        state: the system just after.
        impulses: Λ of this contact [N s] where it closes in an impact, else zeros, shape (rows per contact,).
    """

    time: float
    law: LawName
    contact: int
    before: LawState
    after: LawState
    state: State
    impulses: FloatArray


@dataclass(frozen=True, eq=False)
class Phase:
    """Smooth motion between two events.

    Attributes:
        begin: t at its begin [s].
        end: t at its end [s].
        interpolant: t ↦ (q, u), one after the other.
    """

    begin: float
    end: float
    interpolant: Any


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion.

    Attributes:
        events: in the order of time.
        phases: the smooth motion between them.
        end: the state in which it ends.
    """

    events: Sequence[Event]
    phases: Sequence[Phase]
    end: State

    def at(self, time: float) -> State:
        """Return the state at ``time`` [s]; at an event, the one after it.

        Raises:
            MotionError: if the motion does not reach ``time``.
        """
        if time == self.end.time:
            return self.end
        index = bisect_right([phase.begin for phase in self.phases], time) - 1
        if index < 0 or time > self.phases[index].end:
            raise MotionError(
                f"the motion ends at t = {self.end.time:.9g} s and has no state at t = {time:.9g} s.", self
            )
        both = np.asarray(self.phases[index].interpolant(time), dtype=np.float64)
        n = len(self.end.position)
        return State(time, both[:n], both[n:])


class MotionError(ProxbenchError):
    """A motion cannot be continued.

    Attributes:
        motion: what was found up to there.
    """

    def __init__(self, message: str, motion: Motion) -> None:
        super().__init__(message)
        self.motion = motion


class AccumulationError(MotionError):
    """Infinitely many impacts follow in finite time, which no integration from event to event can pass.

    Attributes:
        contact: which contact bounces.
        impacts: how many impacts were resolved.
        accumulation_time: where they accumulate [s], by the ratio of the last two flights.
    """

    def __init__(self, motion: Motion, contact: int, impacts: int, flight: float, accumulation_time: float) -> None:
        super().__init__(
            f"the impacts of contact {contact} accumulate at t = {accumulation_time:.9g} s: {impacts} are resolved, "
            f"the last flight took {flight:.1e} s, and infinitely many follow; event-driven integration cannot pass "
            "this point, time stepping (Moreau) can.",
            motion,
        )
        self.contact = contact
        self.impacts = impacts
        self.accumulation_time = accumulation_time
