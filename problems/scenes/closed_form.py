"""What scenes whose motion is known in closed form have in common, so that any stepper can be tested on any of them."""

from typing import Protocol

from ..moreau import State
from ..system import System

OVERLAP = 1e-9
"""Depth [m] at which bodies start that touch from the beginning, so that the first step finds their contact."""


class ClosedFormScene(Protocol):
    """A scene with its answer."""

    def system(self) -> System:
        """Return what moves."""
        ...

    def start(self) -> State:
        """Return the state at time 0."""
        ...

    def exact(self, time: float) -> State:
        """Return the state at ``time`` [s] in closed form; where velocities jump, the one after the impact."""
        ...
