"""Motions of an event-driven integrator: smooth phases, the events between them, and errors that end a motion early."""

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
    """A change of the state of a contact. An impact after which the contact opens at once counts as two events.

    Attributes:
        time: t [s].
        law: the law whose state changes.
        contact: index of the contact.
        before: state of the law before the event.
        after: state of the law after the event.
        state: state of the system just after the event.
        impulses: Λ of this contact [N s] if it closes in an impact, else zeros, shape (rows per contact,).
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
        begin: start time [s].
        end: end time [s].
        interpolant: function t ↦ (q, u), shape (n_coordinates + n_dofs,).
    """

    begin: float
    end: float
    interpolant: Any


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion that the event-driven integrator has computed.

    Attributes:
        events: events in the order of time.
        phases: the smooth motion between them.
        end: the final state.
    """

    events: Sequence[Event]
    phases: Sequence[Phase]
    end: State

    def at(self, time: float) -> State:
        """Return the state at ``time`` [s]; at an event, the state after it.

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
        position_and_velocity = np.asarray(self.phases[index].interpolant(time), dtype=np.float64)
        position, velocity = np.split(position_and_velocity, [len(self.end.position)])
        return State(time, position, velocity)


class MotionError(ProxbenchError):
    """A motion cannot be continued, or does not reach a requested time.

    Attributes:
        motion: the motion as far as it was computed.
    """

    def __init__(self, message: str, motion: Motion) -> None:
        super().__init__(message)
        self.motion = motion


class AccumulationError(MotionError):
    """Infinitely many impacts accumulate at a time beyond which event-driven integration cannot continue.

    Attributes:
        contact: the bouncing contact.
        impacts: number of computed impacts.
        accumulation_time: time at which impacts accumulate [s], from the ratio of the last two flights.
    """

    def __init__(self, motion: Motion, contact: int, impacts: int, flight: float, accumulation_time: float) -> None:
        super().__init__(
            f"the impacts of contact {contact} accumulate at t = {accumulation_time:.9g} s: after {impacts} impacts, "
            f"the last flight took {flight:.1e} s, and infinitely many impacts would follow; choose a time-stepping "
            "method, such as Moreau.",
            motion,
        )
        self.contact = contact
        self.impacts = impacts
        self.accumulation_time = accumulation_time
