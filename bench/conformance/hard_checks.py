"""Tests of a solver on the hard cases: one for each group of cases, and two that need hard cases.

No method solves every case. Every solver must return a finite result and a true status, leave its inputs unchanged, and
give the known answer where it claims a solution.
"""

from collections import deque
from functools import partial

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.solver import Solver, Status, Stop
from ...problems.hard import CASE_GROUPS, hard_case
from .checks import Check, Violation, checks, of_iterates
from .samples import supported
from .trial import meet_answer, tried

HARD = Stop(1e-8, max_iterations=20_000, max_seconds=0.5)
"""Limits of the solve of each hard case."""

ACCURACIES = (1e-2, 1e-4, 1e-6, 1e-8)
"""Tolerances that follow each other."""

LEAST_DIFFERENCE = 1e-13
"""Residuals that differ by less are alike."""

SAME_ITERATE = 1e-9
"""Iterates that differ by less, relative to their largest step, repeat each other."""

REPETITIONS = 50
"""Iterations that repeat each other before a cycle must be named."""


def is_true_on(group: str, solver: Solver) -> None:
    """On hard cases of one group: finite, true to its status and the known answer, inputs untouched."""
    for problem in supported(solver, map(hard_case, CASE_GROUPS[group]), "it supports none of these cases"):
        trial = tried(solver, problem, HARD)
        if trial.is_solved and trial.residual <= HARD.tolerance and solver.model.kind == "coulomb":
            meet_answer(problem, trial.solution.impulses)


def gains_by_tolerance(solver: Solver) -> None:
    """A tighter tolerance never ends in a worse residual, unless it is met all the same."""
    for problem in supported(solver):
        before, looser = np.inf, 0.0
        for tolerance in ACCURACIES:
            trial = tried(solver, problem, Stop(tolerance, HARD.max_iterations, HARD.max_seconds))
            if trial.solution.status is Status.TIME_LIMIT:
                break
            if trial.residual > max(before, tolerance) + LEAST_DIFFERENCE:
                raise Violation(
                    f"on {problem.name} a tolerance of {tolerance:g} ends at a residual of {trial.residual:.1e}, "
                    f"though {looser:g} ended at {before:.1e}; return the best iterate."
                )
            before, looser = trial.residual, tolerance


@of_iterates
def names_cycles(solver: Solver) -> None:
    """Iterates that repeat themselves in a cycle of two end OSCILLATING, not at the iteration limit."""
    stop = Stop(1e-10, max_iterations=2000, max_seconds=2.0)
    for problem in supported(solver):
        shown: deque[FloatArray] = deque(maxlen=REPETITIONS)
        status = solver.prepare(problem).solve(stop, observe=partial(_keep, shown)).status
        if status is Status.ITERATION_LIMIT and _is_cycle(shown):
            raise Violation(
                f"on {problem.name} its last {REPETITIONS} iterates repeat each other in a cycle of two, and it ends "
                "at the iteration limit; return Status.OSCILLATING."
            )


def _keep(shown: deque[FloatArray], iteration: int, impulses: FloatArray) -> None:
    shown.append(np.array(impulses))


def _is_cycle(shown: deque[FloatArray]) -> bool:
    """Whether each iterate equals the last but one before it and differs from the last."""
    if len(shown) < REPETITIONS:
        return False
    iterates = np.array(shown)
    step = np.abs(np.diff(iterates, axis=0)).max()
    returned = np.abs(iterates[2:] - iterates[:-2]).max()
    return bool(step > 0.0 and returned <= SAME_ITERATE * step)


HARD_CHECKS: tuple[Check[Solver], ...] = (
    *checks(tolerances=gains_by_tolerance, cycles=names_cycles),
    *(
        Check(
            f"hard {group}",
            f"On hard cases ({group}): finite, true to its status and the known answer, inputs untouched.",
            partial(is_true_on, group),
        )
        for group in CASE_GROUPS
    ),
)
"""All tests on hard cases."""
