"""The promises of a solver on the hard cases, one test for each kind of case, and those that only hard cases try.

No method solves every case, and none must; what every solver must give is a finite result, a status that is true,
inputs left alone, and the known answer where it says that it has solved.
"""

from functools import partial

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.hard import CASE_GROUPS, hard_case
from ...solvers.interface import Solver, Status, Stop, shows_iterates
from .checks import Check, NotApplicable, Violation
from .samples import samples
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
    """Try a solver on the cases of one group, as far as it supports them."""
    seen = 0
    for name in CASE_GROUPS[group]:
        problem = hard_case(name)
        if solver.supports(problem) is not None:
            continue
        seen += 1
        trial = tried(solver, problem, HARD)
        if trial.is_solved and trial.residual <= HARD.tolerance and solver.model.kind == "coulomb":
            meet_answer(problem, trial.solution.impulses)
    if not seen:
        raise NotApplicable("it supports none of these cases")


def gains_by_tolerance(solver: Solver) -> None:
    """A tighter tolerance never ends in a worse residual, unless it is met all the same."""
    for problem in _supported(solver):
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


def names_cycles(solver: Solver) -> None:
    """Iterates that repeat themselves in a cycle of two end OSCILLATING, not at the iteration limit."""
    if not shows_iterates(solver):
        raise NotApplicable("it has no iterates to show (has_iterates is False)")
    stop = Stop(1e-10, max_iterations=2000, max_seconds=2.0)
    for problem in _supported(solver):
        shown: list[FloatArray] = []
        status = solver.prepare(problem).solve(stop, observe=partial(_keep, shown)).status
        if status is Status.ITERATION_LIMIT and _is_cycle(shown):
            raise Violation(
                f"on {problem.name} its last {REPETITIONS} iterates repeat each other in a cycle of two, and it ends "
                "at the iteration limit; return Status.OSCILLATING."
            )


def _keep(shown: list[FloatArray], iteration: int, impulses: FloatArray) -> None:
    shown.append(np.array(impulses))
    del shown[:-REPETITIONS]


def _is_cycle(shown: list[FloatArray]) -> bool:
    """Whether each iterate equals the last but one before it and differs from the last."""
    if len(shown) < REPETITIONS:
        return False
    iterates = np.array(shown)
    step = np.abs(np.diff(iterates, axis=0)).max()
    returned = np.abs(iterates[2:] - iterates[:-2]).max()
    return bool(step > 0.0 and returned <= SAME_ITERATE * step)


def _supported(solver: Solver) -> list[ContactProblem]:
    found = [problem for problem in samples() if solver.supports(problem) is None]
    if not found:
        raise NotApplicable("it supports none of the small problems")
    return found


def _group_check(group: str) -> Check[Solver]:
    promise = f"On hard cases ({group}): finite, true to its status and the known answer, inputs untouched."
    return Check(f"hard {group}", promise, partial(is_true_on, group))


HARD_CHECKS: tuple[Check[Solver], ...] = (
    Check("tolerances", (gains_by_tolerance.__doc__ or "").strip(), gains_by_tolerance),
    Check("cycles", (names_cycles.__doc__ or "").strip(), names_cycles),
    *(_group_check(group) for group in CASE_GROUPS),
)
"""All tests on hard cases."""
