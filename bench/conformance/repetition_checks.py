"""Test that a solver solves each problem again instead of returning an earlier answer."""

import time

import numpy as np
from threadpoolctl import threadpool_limits

from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import Solution, Solver, Status, Stop, draws_randomly
from ...problems.hard import hard_case
from ..measure.contacts.variants import in_other_units, perturbed_copy
from .checks import Violation
from .samples import random_contacts, supported
from .trial import solution_of

STOP = Stop(1e-9, max_iterations=5000, max_seconds=0.5)
"""Limits of each solve."""

REPEATS = 5
"""Number of repeated solves that are compared with the first one."""

N_CONTACTS = 20
"""Number of contacts of each random problem."""

ATTEMPTS = 4
"""Largest number of copies of a problem that are timed; a solver fails if its first solve is slow on all of them."""

RATIO, ALLOWANCE_SECONDS = 3.0, 2e-4
"""Factor and time [s] by which a first solve, with cold caches, may take longer than repeated ones."""


def solves_each_time(solver: Solver) -> None:
    """Repeated solves of a problem give identical results and take the same time, apart from cache effects."""
    problems = [hard_case("hard-stack-100"), *(random_contacts(N_CONTACTS, dim) for dim in (3, 1))]
    problem = supported(solver, problems, "it supports none of the problems that are large enough for timing")[0]
    times: list[tuple[float, float]] = []
    with threadpool_limits(1):  # busy-waiting library threads would count, mostly in a first solve
        solution_of(solver, perturbed_copy(problem), STOP)
        for _ in range(ATTEMPTS):
            first, repeated = _compare_first_and_repeated(solver, problem)
            if first <= RATIO * repeated + ALLOWANCE_SECONDS:
                return
            times.append((first, repeated))
    first, repeated = min(times)
    raise Violation(
        f"a first solve of {problem.name} takes {first:.2g} s of processor time and a repeated one {repeated:.2g} s; "
        "do not store answers between solves."
    )


def _compare_first_and_repeated(solver: Solver, problem: ContactProblem) -> tuple[float, float]:
    """Return the processor times of a first solve and, as a median, of repeated solves [s] of a copy in other units.

    Raises:
        Violation: if their results are not identical.
    """
    changed = in_other_units(perturbed_copy(problem)).problem.renamed(problem.name)
    first, first_seconds = _timed_solve(solver, changed)
    seconds: list[float] = []
    for _ in range(REPEATS):
        repeated, repeated_seconds = _timed_solve(solver, changed)
        seconds.append(repeated_seconds)
        has_timed_out = Status.TIME_LIMIT in (first.status, repeated.status)
        is_equal = np.array_equal(first.impulses, repeated.impulses, equal_nan=True)
        if not (draws_randomly(solver) or has_timed_out or is_equal):
            difference = np.abs(first.impulses - repeated.impulses).max()
            raise Violation(
                f"the first and a later solve of {problem.name} differ by {difference:.1e} N s; keep no state between "
                "solves, or set is_randomised = True."
            )
    return first_seconds, float(np.median(seconds))


def _timed_solve(solver: Solver, problem: ContactProblem) -> tuple[Solution, float]:
    """Return a solution and its processor time [s], which does not depend on the load of the machine."""
    fresh = problem.fresh()
    began = time.process_time()
    solution = solution_of(solver, fresh, STOP)
    return solution, time.process_time() - began
