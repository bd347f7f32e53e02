"""Tests of a solver on each group of hard cases, of its tolerances, and of its reports of cycles.

No method solves every case. Every solver must return a finite result and a correct status, leave its inputs unchanged,
and agree with the known answer if it claims a solution.
"""

from collections import deque
from functools import partial

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.solver import Solver, Status, Stop
from ...problems.hard import CASE_GROUPS, hard_case
from .checks import Check, Violation, checks, requires_iterates
from .samples import supported
from .trial import require_known_answer, run_trial

HARD = Stop(1e-8, max_iterations=20_000, max_seconds=0.2)
"""Limits of the solve of each hard case."""

CYCLING = Stop(1e-10, max_iterations=2000, max_seconds=2.0)
"""Limits of a solve whose last iterates are compared."""

ACCURACIES = (1e-2, 1e-4, 1e-6, 1e-8)
"""Tolerances in descending order."""

MIN_DIFFERENCE = 1e-13
"""Difference below which residuals count as equal."""

SAME_ITERATE = 1e-9
"""Difference below which iterates count as equal, relative to their largest step."""

REPETITIONS = 50
"""Number of iterations in a cycle after which a solver must report the cycle."""


def is_truthful_on_group(group: str, solver: Solver) -> None:
    """On hard cases of one group, results are finite and match status and known answer; inputs do not change."""
    for problem in supported(solver, map(hard_case, CASE_GROUPS[group]), "it supports none of these cases"):
        trial = run_trial(solver, problem, HARD)
        if trial.is_solved and trial.residual <= HARD.tolerance and solver.model.kind == "coulomb":
            require_known_answer(problem, trial.solution.impulses)


def improves_with_tolerance(solver: Solver) -> None:
    """A smaller tolerance does not increase the residual, unless the residual is still within the tolerance."""
    for problem in supported(solver):
        previous_residual, previous_tolerance = np.inf, 0.0
        for tolerance in ACCURACIES:
            trial = run_trial(solver, problem, Stop(tolerance, HARD.max_iterations, HARD.max_seconds))
            if trial.solution.status is Status.TIME_LIMIT:
                break
            if trial.residual > max(previous_residual, tolerance) + MIN_DIFFERENCE:
                raise Violation(
                    f"on {problem.name} a tolerance of {tolerance:g} gives a residual of {trial.residual:.1e}, "
                    f"but {previous_tolerance:g} gives {previous_residual:.1e}; return the best iterate."
                )
            previous_residual, previous_tolerance = trial.residual, tolerance


@requires_iterates
def reports_cycles(solver: Solver) -> None:
    """A solve whose iterates alternate between two values returns OSCILLATING before the iteration limit."""
    for problem in supported(solver):
        iterates: deque[FloatArray] = deque(maxlen=REPETITIONS)
        status = solver.prepare(problem).solve(CYCLING, observe=partial(_record_iterate, iterates)).status
        if status is Status.ITERATION_LIMIT and _is_cycle(iterates):
            raise Violation(
                f"on {problem.name} its last {REPETITIONS} iterates alternate between two values, and it "
                "continues to the iteration limit; return Status.OSCILLATING."
            )


def _record_iterate(iterates: deque[FloatArray], iteration: int, impulses: FloatArray) -> None:
    iterates.append(np.array(impulses))


def _is_cycle(iterates: deque[FloatArray]) -> bool:
    """Return whether each iterate equals the one two iterations before, and differs from the previous one."""
    if len(iterates) < REPETITIONS:
        return False
    impulses = np.array(iterates)
    step = np.abs(np.diff(impulses, axis=0)).max()
    two_step_change = np.abs(impulses[2:] - impulses[:-2]).max()
    return bool(step > 0.0 and two_step_change <= SAME_ITERATE * step)


HARD_CHECKS: tuple[Check[Solver], ...] = (
    *checks(tolerances=improves_with_tolerance, cycles=reports_cycles),
    *(
        Check(
            f"hard {group}",
            f"On hard cases ({group}), results are finite and match their status and the known answer; "
            "inputs do not change.",
            partial(is_truthful_on_group, group),
        )
        for group in CASE_GROUPS
    ),
)
"""All tests on hard cases."""
