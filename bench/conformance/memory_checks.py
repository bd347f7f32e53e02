"""The promise that a solver solves each time what it is given, and does not answer from what it has solved before."""

import time

import numpy as np

from ...problems.contact.problem import ContactProblem
from ...problems.hard import hard_case
from ...solvers.interface import Solution, Solver, Status, Stop, draws_randomly
from ..measure.control import ATTEMPTS, explains
from ..measure.variants import another, in_other_units
from .checks import Violation
from .samples import random_contacts, supported
from .trial import solution_of

STOP = Stop(1e-9, max_iterations=2000, max_seconds=1.0)
"""Limits of the solve of each problem."""

REPEATS = 5
"""Solves that a first one is compared with."""

N_CONTACTS = 20


def solves_each_time(solver: Solver) -> None:
    """The first and the n-th solve of a problem end in the same bits and take the same time, but for caches."""
    problems = [hard_case("hard-stack-100"), *(random_contacts(N_CONTACTS, dim) for dim in (3, 1))]
    problem = supported(solver, problems, "it supports none of the problems that are large enough to be timed")[0]
    solution_of(solver, another(problem), STOP)
    found = [_first_and_repeated(solver, problem, number) for number in range(ATTEMPTS)]
    if any(explains(repeated, first) for first, repeated in found):
        return
    first, repeated = min(found)
    raise Violation(
        f"a first solve of {problem.name} takes {first:.2g} s and the same again {repeated:.2g} s; keep no answers of "
        "one solve for another."
    )


def _first_and_repeated(solver: Solver, problem: ContactProblem, number: int) -> tuple[float, float]:
    """Return the time of a first solve and the median time of repeated ones [s], in units that are new to the solver.

    Raises:
        Violation: if they do not end in the same bits.
    """
    changed = in_other_units(another(problem), number).problem.renamed(problem.name)
    worked = time.process_time()
    first, first_seconds = _timed(solver, changed)
    worked = time.process_time() - worked  # less than the time on a busy machine
    seconds: list[float] = []
    for _ in range(REPEATS):
        again, more = _timed(solver, changed)
        seconds.append(more)
        is_cut = Status.TIME_LIMIT in (first.status, again.status)
        if not (draws_randomly(solver) or is_cut or np.array_equal(first.impulses, again.impulses, equal_nan=True)):
            difference = np.abs(first.impulses - again.impulses).max()
            raise Violation(
                f"the first and a later solve of {problem.name} differ by {difference:.1e} N s; let none depend on "
                "another, or say is_randomised = True."
            )
    return min(first_seconds, worked), float(np.median(seconds))


def _timed(solver: Solver, problem: ContactProblem) -> tuple[Solution, float]:
    fresh = problem.fresh()
    began = time.perf_counter()
    solution = solution_of(solver, fresh, STOP)
    return solution, time.perf_counter() - began
