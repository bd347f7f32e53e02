"""Test that a solver has no side effects on its process."""

import _thread
import os
import time

from ...problems.contact.solver import Solver, Stop
from ..isolation.process_state import ProcessState, replacement_text
from ..isolation.process_tree import descendants
from .checks import Violation
from .samples import supported

STOP = Stop(1e-4, max_iterations=200, max_seconds=0.5)
"""Limits of each solve."""

WAIT_SECONDS = 1.0
"""Time to wait for threads and processes to end [s]."""


def has_no_side_effects(solver: Solver) -> None:
    """The solver replaces no functions of other modules, restores settings, and ends its threads and processes."""
    problems = supported(solver)
    before, n_before = ProcessState.now(), _n_running()
    for problem in problems:
        solver.prepare(problem).solve(STOP)
    if fault := replacement_text(before):
        raise Violation(f"{fault}.")
    if changed := before.changed_settings():
        raise Violation(f"it changed {_join_words(changed)}; restore global state before solve returns.")
    deadline = time.monotonic() + WAIT_SECONDS
    while _n_running() > n_before and time.monotonic() < deadline:
        time.sleep(0.01)
    if (n_left := _n_running() - n_before) > 0:
        raise Violation(f"it leaves {n_left} threads or processes running; end them before solve returns.")


def _n_running() -> int:
    """Return the number of other Python threads and of descendant processes."""
    return _thread._count() + len(descendants(os.getpid()))


def _join_words(words: list[str]) -> str:
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))
