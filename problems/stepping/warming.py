"""Compiling and loading kernels, which is no part of any step: it happens before the clock starts."""

import contextlib
from itertools import islice
from time import perf_counter

import numpy as np

from ..mechanics.state import State
from .contact_states import LawStates
from .moreau import Moreau, Step
from .variable_step import VariableStep

MOST_STEPS = 200
"""Accepted steps that a variable stepper takes at most to warm up: balls have fallen on each other by then."""


class WarmClock:
    """Times steps of a fixed size. The first one of each kind, free, in or from contact, projected, is taken twice.

    What was compiled or loaded in the first go is there in the second, which is timed and kept; steps depend on the
    state alone, so that it is the same step.
    """

    def __init__(self) -> None:
        self._known: set[tuple[bool, ...]] = set()

    def step(self, stepper: Moreau, state: State) -> tuple[Step, float]:
        """Take one step; return it with its wall time [s]."""
        while True:
            began = perf_counter()
            step = stepper.step(state)
            seconds = perf_counter() - began
            kind = (step.contacts is not None, len(state.keys) > 0, _is_projected(stepper, state, step))
            if kind in self._known:
                return step, seconds
            self._known.add(kind)


def _is_projected(stepper: Moreau, state: State, step: Step) -> bool:
    """Whether the end of a step is not where its velocity leads."""
    move, half = stepper.system.move, 0.5 * stepper.time_step
    end = move(move(state.position, state.velocity, half), step.state.velocity, half)
    return not np.array_equal(end, step.state.position, equal_nan=True)


def warm_up(stepper: VariableStep, start: State, until: float, states: LawStates | None) -> None:
    """Take steps of a variable size in vain, until one of them is in contact; arguments as in ``VariableStep.steps``.

    What fails here fails again where steps are kept.
    """
    with contextlib.suppress(Exception, SystemExit):
        for taken in islice(stepper.steps(start, until, states), MOST_STEPS):
            if taken.states.closed:
                return
