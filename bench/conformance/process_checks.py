"""The promise that a solver leaves the process it works in as it was."""

import time

from ...problems.contact.solver import Solver, Stop
from ..isolation.process_state import ProcessState, replaced_names
from .checks import Violation
from .samples import supported

STOP = Stop(1e-4, max_iterations=200, max_seconds=0.5)
"""Limits of the solve of each problem."""

PATIENCE_SECONDS = 1.0
"""What a thread or a process may take to end [s]."""


def has_no_side_effects(solver: Solver) -> None:
    """The process stays as it was: nothing of others replaced, no setting changed, nothing left running."""
    problems = supported(solver)
    before = ProcessState.now()
    for problem in problems:
        solver.prepare(problem).solve(STOP)
    if fault := replaced_names(before):
        raise Violation(f"{fault}.")
    if changed := before.changed():
        raise Violation(f"it changed {_listed(changed)}; put back what belongs to all before solve returns.")
    deadline = time.monotonic() + PATIENCE_SECONDS
    while before.left() and time.monotonic() < deadline:
        time.sleep(0.01)
    if left := before.left():
        raise Violation(f"it left {_listed(left)} running; end them before solve returns.")


def _listed(words: list[str]) -> str:
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))
