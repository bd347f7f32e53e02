"""Which laws project in a step: open or closed contacts, sticking or slipping friction, read off the prox functions.

A law projects where its prox argument x = Λ − ξ/α lies outside its set or on its boundary (Studer & Glocker 2005,
section 6): a unilateral law that projects is open, x_N ≤ 0; a friction law that projects slips, ‖x_T‖ ≥ b. A contact
that is not active, g ≥ 0, is open, and the friction of an open contact, whose set is {0}, projects. A slip that turns
round within one step passes through sticking without showing it, and counts as a change as well.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from .moreau import Step

BORDER = 1e-8
"""Relative width of the boundary of a friction law, on which rounding would decide. A contact that is held by others
too may carry any friction up to its bound without moving: it sticks."""

LawName = Literal["unilateral", "friction"]
LawState = Literal["open", "closed", "stick", "slip"]


@dataclass(frozen=True)
class SwitchingPoint:
    """A law that switches: it projects in one step and not in the next, or the reverse.

    Attributes:
        begin: the switch is not before this time [s].
        end: and not after this one [s].
        law: which law of the contact.
        contact: key of the contact.
        before: the state of the law before.
        after: its state after; slip after slip is one that turns round.
    """

    begin: float
    end: float
    law: LawName
    contact: int
    before: LawState
    after: LawState


@dataclass(frozen=True, eq=False)
class LawStates:
    """The states of all laws in a step. Contacts that are not mentioned are open.

    Attributes:
        closed: keys of closed contacts, ascending.
        sticking: keys of sticking contacts, ascending.
        slips: friction impulse Λ_T of each closed contact that slips, by its key.
    """

    closed: tuple[int, ...] = ()
    sticking: tuple[int, ...] = ()
    slips: Mapping[int, tuple[float, ...]] = field(default_factory=dict)

    def continues(self, before: "LawStates") -> bool:
        """Whether no law has switched since ``before``."""
        is_same = self.closed == before.closed and self.sticking == before.sticking
        return is_same and not self._turned(before)

    def switches_since(self, before: "LawStates", begin: float, end: float) -> tuple[SwitchingPoint, ...]:
        """Return what has changed since ``before``, between two times [s], by contact, the unilateral law first."""
        switches: list[SwitchingPoint] = []
        turned = self._turned(before)
        for key in sorted({*self.closed, *before.closed}):
            was, is_now = key in before.closed, key in self.closed
            if was != is_now:
                names: tuple[LawState, LawState] = ("closed", "open") if was else ("open", "closed")
                switches.append(SwitchingPoint(begin, end, "unilateral", key, *names))
            stuck, sticks = key in before.sticking, key in self.sticking
            if stuck != sticks or key in turned:
                names = ("stick" if stuck else "slip", "stick" if sticks else "slip")
                switches.append(SwitchingPoint(begin, end, "friction", key, *names))
        return tuple(switches)

    def _turned(self, before: "LawStates") -> list[int]:
        both = self.slips.keys() & before.slips.keys()
        return [key for key in both if np.dot(self.slips[key], before.slips[key]) < 0.0]


def law_states(step: Step) -> LawStates:
    """Return the states of all laws in a step."""
    if step.contacts is None or step.problem is None:
        return LawStates()
    problem, layout, keys = step.problem, step.problem.layout, step.contacts.keys
    alpha = layout.pad(problem.delassus_diagonal)
    impulses = layout.pad(step.impulses)
    velocity = layout.pad(problem.relative_velocity(step.impulses))
    stiffness = alpha[:, 1:].max(axis=1, initial=0.0)
    is_closed = impulses[:, 0] * alpha[:, 0] > velocity[:, 0]
    bound = (layout.fixed_bound + layout.friction_coefficient * np.maximum(impulses[:, 0], 0.0)) * stiffness
    argument = stiffness[:, None] * impulses[:, 1:] - velocity[:, 1:]
    sticks = is_closed & (bound > 0.0) & (np.linalg.norm(argument, axis=1) <= (1.0 + BORDER) * bound)
    slips = np.flatnonzero(is_closed & ~sticks)
    friction = {int(keys[row]): tuple(impulses[row, 1:].tolist()) for row in slips}
    return LawStates(tuple(keys[is_closed].tolist()), tuple(keys[sticks].tolist()), friction)
