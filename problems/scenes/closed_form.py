"""What scenes whose motion is known in closed form have in common, so that any stepper can be tested on any of them."""

from math import inf
from typing import Protocol

from ..errors import ProblemError
from ..mechanics.state import State
from ..mechanics.system import System

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


def check_positive(scene: object, what: str, *names: str) -> None:
    """Look at numbers of a scene that must be positive and finite.

    Args:
        scene: which has them as attributes.
        what: the scene, as the sentence calls it: "a bouncing ball".
        names: of the numbers.

    Raises:
        ProblemError: for the first that is not.
    """
    for name in names:
        value = getattr(scene, name)
        if not 0.0 < value < inf:
            raise ProblemError(f"{name} of {what} must be positive, got {value}.")
