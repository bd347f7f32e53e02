"""Compiling and loading kernels, which is no part of any step: it happens before the clock starts."""

import contextlib
from itertools import islice
from time import perf_counter
from typing import Any

import numpy as np
from numba.core import event

from ..state import State
from .contact_states import LawStates
from .moreau import Moreau, Step
from .variable_step import VariableStep

MOST_STEPS = 200
"""Accepted steps that a variable stepper takes at most to warm up: balls have fallen on each other by then."""

COMPILER = "numba:compiler_lock"
"""What numba calls its compiler at work: whatever compiles a kernel or loads it from its cache takes this lock."""


class _Compiler(event.Listener):
    """Counts how often the compiler was at work."""

    n_times = 0

    def on_start(self, event: Any) -> None:
        self.n_times += 1

    def on_end(self, event: Any) -> None:
        """Nothing more to count."""


class WarmClock:
    """Times steps of a fixed size; those in which something may have been compiled or loaded are taken twice.

    They are the first one of each kind, free, in or from contact, projected, and whichever makes the compiler work. In
    the second go, which is timed and kept, all is there; steps depend on the state alone, so that it is the same step.
    """

    def __init__(self) -> None:
        self._known: set[tuple[bool, ...]] = set()
        self._compiler = _Compiler()

    def step(self, stepper: Moreau, state: State) -> tuple[Step, float]:
        """Take one step; return it with its wall time [s]."""
        step, seconds, compiled = self._timed(stepper, state)
        kind = (step.contacts is not None, len(state.keys) > 0, _is_projected(stepper, state, step))
        if compiled or kind not in self._known:
            self._known.add(kind)
            step, seconds, _ = self._timed(stepper, state)
        return step, seconds

    def _timed(self, stepper: Moreau, state: State) -> tuple[Step, float, bool]:
        """Take one step; return it with its wall time [s], and whether the compiler was at work in it."""
        before = self._compiler.n_times
        with event.install_listener(COMPILER, self._compiler):
            began = perf_counter()
            step = stepper.step(state)
            seconds = perf_counter() - began
        return step, seconds, self._compiler.n_times > before


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
