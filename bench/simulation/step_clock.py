"""Keeping compilation out of the time of steps: kernels are compiled, or loaded, before the clock starts."""

import contextlib
from itertools import islice
from time import perf_counter
from typing import Any

import numpy as np
from numba.core import event

from ...problems.contact.solver import Stop
from ...problems.motion.scenes.scene import Scene
from ...problems.motion.state import State
from ...problems.motion.stepping.midpoint import ContactSolver, MidpointRule
from ...problems.motion.stepping.step import LawStates, Step
from ...problems.motion.stepping.variable_stepper import VariableStepper

MAX_WARM_UP_STEPS = 200
"""Accepted steps that a variable stepper takes at most to warm up: balls have fallen on each other by then."""

COMPILER_EVENT = "numba:compiler_lock"
"""The event of numba's compiler: whatever compiles a kernel, or loads it from its cache, takes this lock."""


class _CompilationCounter(event.Listener):
    """Counts how often the compiler ran."""

    n_times = 0

    def on_start(self, event: Any) -> None:
        self.n_times += 1

    def on_end(self, event: Any) -> None:
        """Nothing more to count."""


class WarmClock:
    """Times steps of a fixed size, and takes those twice in which something may have been compiled or loaded.

    These are the first step of each kind (free, in or after contact, projected) and every step in which the compiler
    runs. The second result is timed and kept; steps depend on the state alone, so that it is the same step.
    """

    def __init__(self) -> None:
        self._known: set[tuple[bool, ...]] = set()
        self._compiler = _CompilationCounter()

    def step(self, rule: MidpointRule, state: State) -> tuple[Step, float]:
        """Take one step; return it with its wall time [s]."""
        step, seconds, compiled = self._timed(rule, state)
        kind = (step.contacts is not None, len(state.keys) > 0, _is_projected(rule, state, step))
        if compiled or kind not in self._known:
            self._known.add(kind)
            step, seconds, _ = self._timed(rule, state)
        return step, seconds

    def _timed(self, rule: MidpointRule, state: State) -> tuple[Step, float, bool]:
        """Take one step; return it with its wall time [s], and whether the compiler ran in it."""
        before = self._compiler.n_times
        with event.install_listener(COMPILER_EVENT, self._compiler):
            began = perf_counter()
            step = rule.step(state)
            seconds = perf_counter() - began
        return step, seconds, self._compiler.n_times > before


def _is_projected(rule: MidpointRule, state: State, step: Step) -> bool:
    """Whether the end of a step is not where its velocity leads."""
    move, half = rule.system.move, 0.5 * rule.time_step
    end = move(move(state.position, state.velocity, half), step.state.velocity, half)
    return not np.array_equal(end, step.state.position, equal_nan=True)


def warm_up(
    stepper: VariableStepper,
    scene: Scene,
    solver: ContactSolver,
    stop: Stop,
    start: State,
    until: float,
    states: LawStates | None,
) -> None:
    """Take steps and discard them, until one of them is in contact; arguments as in ``Stepper.steps``.

    Errors are ignored: they recur where steps are kept.
    """
    with contextlib.suppress(Exception, SystemExit):
        for taken in islice(stepper.steps(scene, solver, stop, start, until, states=states), MAX_WARM_UP_STEPS):
            if taken.states.closed:
                return
