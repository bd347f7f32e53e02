"""Triggers that end a phase of smooth motion: functions of the state that cross zero from above at an event."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ....arrays import FloatArray
from .acceleration import AccelerationLaws, Modes

MARGIN = 1e-13
"""Depth below zero, as a fraction of the largest force or velocity, at which a function counts as negative."""

Kind = Literal["hit", "turn", "open", "slip", "stick"]
StateFunction = Callable[[FloatArray, FloatArray], float]


@dataclass(frozen=True, eq=False)
class Trigger:
    """An event that may end a phase.

    Attributes:
        kind: "hit" (g of an open contact), "turn" (γ_N of one that has just opened), "open" (λ_N), "slip" (the reserve
            of friction μ λ_N ∓ λ_T), "stick" (|γ_T|).
        contact: the contact of the event.
        function: function of (q, u) that falls below zero at the event.
        direction: sign of γ_T after a "slip" event.
    """

    kind: Kind
    contact: int
    function: StateFunction
    direction: float = 0.0

    def is_due(self, position: FloatArray, velocity: FloatArray) -> bool:
        """Return whether the event is due in the state in which its phase begins."""
        return self.function(position, velocity) <= 0.0

    def for_scipy(self) -> Any:
        """Return the terminal event function for ``solve_ivp``, of t and of (q, u) in one array."""

        def event(time: float, state: FloatArray) -> float:
            half = len(state) // 2
            return self.function(state[:half], state[half:])

        event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
        return event


@dataclass(frozen=True, eq=False)
class TriggerFactory:
    """A factory of the triggers of one phase.

    Attributes:
        laws: laws of the system at acceleration level.
        modes: modes of the phase.
        armed: whether the trigger of an open contact fires when the gap closes; otherwise when the gap begins to
            close, shape (n_contacts,).
    """

    laws: AccelerationLaws
    modes: Modes
    armed: NDArray[np.bool_]

    def triggers(self, position: FloatArray, velocity: FloatArray) -> list[Trigger]:
        """Return the triggers of the phase that begins at (q, u); its forces and velocities scale the margins."""
        _, forces = self.laws.motion(position, velocity, self.modes)
        contact_velocity = self.laws.system.directions(position).T @ velocity
        tiny = np.finfo(np.float64).tiny  # suppresses events of forces and velocities that remain zero
        force = MARGIN * float(np.abs(forces).max(initial=0.0)) + tiny
        speed = MARGIN * float(np.abs(contact_velocity).max(initial=0.0)) + tiny
        result = []
        for i, closed in enumerate(self.modes.closed.tolist()):
            if not closed and self.armed[i]:
                result.append(Trigger("hit", i, self._gap(i)))
            elif not closed:
                result.append(Trigger("turn", i, self._velocity(i, 0, 1.0, speed)))
            else:
                result += self._closed_triggers(i, force, speed)
        return result

    def _closed_triggers(self, i: int, force: float, speed: float) -> list[Trigger]:
        triggers = [Trigger("open", i, self._load(i, force))]
        if self.laws.width == 2 and self.modes.sticks(i):
            triggers += [Trigger("slip", i, self._reserve(i, sign, force), -sign) for sign in (1.0, -1.0)]
        elif self.laws.width == 2:
            triggers.append(Trigger("stick", i, self._velocity(i, 1, float(self.modes.slip[i]), speed)))
        return triggers

    def _gap(self, i: int) -> StateFunction:
        return lambda q, u: float(self.laws.system.gap(q)[i])

    def _velocity(self, i: int, row: int, sign: float, margin: float) -> StateFunction:
        column = self.laws.width * i + row
        return lambda q, u: sign * float(self.laws.system.directions(q)[:, column] @ u) + margin

    def _load(self, i: int, margin: float) -> StateFunction:
        return lambda q, u: float(self.laws.motion(q, u, self.modes)[1][i, 0]) + margin

    def _reserve(self, i: int, sign: float, margin: float) -> StateFunction:
        friction = float(np.asarray(self.laws.system.friction)[i])

        def reserve(q: FloatArray, u: FloatArray) -> float:
            normal, tangential = self.laws.motion(q, u, self.modes)[1][i].tolist()
            return float(friction * normal - sign * tangential + margin)

        return reserve
