"""Tests of a solver on small problems, one for each requirement.

A test uses the problems that the solver ``supports``. Tests on hard cases and on transformed problems are in other
files; ``SOLVER_CHECKS`` includes them.
"""

import ctypes
import io
import os
import pickle
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from functools import wraps

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import Solution, Solver, Status, Stop
from ...solvers.contract import form_fault, prepared_fault, reason_fault
from .checks import Check, NotApplicable, Violation, checks, requires_iterates
from .hard_checks import HARD_CHECKS
from .invariance_checks import INVARIANCE_CHECKS
from .process_checks import has_no_side_effects
from .repetition_checks import solves_each_time
from .samples import at_rest, empty, infeasible, random_contacts, samples, supported
from .trial import confirmed_residual, own_residual, require_finite, require_unchanged, solution_of

ACCURACIES = (1e-2, 1e-4, 1e-6, 1e-8)
"""Tolerances at which claims are compared with the judge."""

DEFAULT_STOP = Stop(1e-6, max_iterations=2000, max_seconds=1.0)
"""Tolerance and limits of solves in tests that are not about limits."""

USEFUL_ACCURACY = 1e-3
"""Judged residual that a solver must reach on at least one problem under its own model; Λ = 0 never reaches it."""

SLACK_SECONDS = 1.0
"""Time by which a solve may exceed its time limit, to finish an iteration [s]."""


def on_samples(test: Callable[[Solver, ContactProblem], None]) -> Callable[[Solver], None]:
    """Return the test of a solver on every sample that it supports."""

    @wraps(test)
    def on_each(solver: Solver) -> None:
        for problem in _supported(solver):
            test(solver, problem)

    return on_each


def conforms_to_interface(solver: Solver) -> None:
    """Name, model, ``supports``, ``prepare`` and ``solve`` conform to the interface."""
    fault = form_fault(solver) or prepared_fault(solver.prepare(_supported(solver)[0]))
    if fault:
        raise Violation(f"{fault}.")


def can_be_pickled(solver: Solver) -> None:
    """The solver can be pickled, because every case runs in another process."""
    try:
        name = pickle.loads(pickle.dumps(solver)).name
    except Exception as error:
        remedy = "store plain options only, and define its class in a module"
        raise Violation(f"it cannot be pickled: {error}; {remedy}.") from error
    if name != solver.name:
        raise Violation(f"after pickling, its name changes from {solver.name!r} to {name!r}; pickle all its options.")


def declines_through_supports(solver: Solver) -> None:
    """``supports`` is deterministic and returns None or a reason; supported problems never give UNSUPPORTED."""
    for problem in samples():
        fault = reason_fault(solver.supports(problem))
        if fault:
            raise Violation(f"on {problem.name}: {fault}.")
        answers = {solver.supports(problem.fresh()) is None for _ in range(3)}
        if len(answers) > 1:
            raise Violation(f"supports is not deterministic on {problem.name}; make it depend only on the problem.")
    for problem in _supported(solver):
        if solution_of(solver, problem, DEFAULT_STOP).status is Status.UNSUPPORTED:
            raise Violation(
                f"it returns UNSUPPORTED for {problem.name}, but supports returned None; return a reason there."
            )


@on_samples
def returns_finite_impulses(solver: Solver, problem: ContactProblem) -> None:
    """Impulses are finite floats of shape (n_rows,), whatever the status."""
    for stop in (DEFAULT_STOP, Stop(1e-300, max_iterations=3, max_seconds=1.0)):
        require_finite(problem, solution_of(solver, problem, stop))


@on_samples
def leaves_inputs_unchanged(solver: Solver, problem: ContactProblem) -> None:
    """A solve modifies neither the problem nor the initial impulses."""
    digest, start = problem.fresh().digest, np.full(problem.n_rows, 0.1)
    solver.prepare(problem).solve(DEFAULT_STOP, start=start)
    require_unchanged(problem, digest)
    if not np.array_equal(start, np.full(problem.n_rows, 0.1)):
        raise Violation(f"it modified the initial impulses of {problem.name}; copy start before modifying it.")


@on_samples
def is_deterministic(solver: Solver, problem: ContactProblem) -> None:
    """Repeated solves, prepared once or anew, give identical results and leave earlier results unchanged."""
    prepared = solver.prepare(problem)
    first = prepared.solve(DEFAULT_STOP)
    impulses = first.impulses.copy()
    repeated, prepared_anew = prepared.solve(DEFAULT_STOP), solution_of(solver, problem.fresh(), DEFAULT_STOP)
    if not np.array_equal(impulses, first.impulses, equal_nan=True):
        raise Violation(f"a second solve of {problem.name} modified the impulses returned by the first; return a copy.")
    for description, other in (("the same prepared problem", repeated), ("a problem prepared anew", prepared_anew)):
        if not _have_equal_results(first, other):
            raise Violation(
                f"two solves of {problem.name} differ by up to {np.abs(other.impulses - impulses).max():.1e} N s "
                f"({first.iterations} and {other.iterations} iterations), the second on {description}; keep no state "
                "between solves, and do not depend on random numbers or time."
            )


@on_samples
def claims_truthfully(solver: Solver, problem: ContactProblem) -> None:
    """SOLVED is returned only if the judged residual under the solver's model is at most ten times the tolerance."""
    for tolerance in ACCURACIES:
        solution = solution_of(solver, problem, replace(DEFAULT_STOP, tolerance=tolerance))
        confirmed_residual(solver, problem, solution, tolerance)


def is_useful(solver: Solver) -> None:
    """At least one problem is solved to a residual of 1e-3 under the solver's model."""
    best, name = np.inf, ""
    problems = _supported(solver)
    for problem in problems:
        solution = solution_of(solver, problem, replace(DEFAULT_STOP, tolerance=USEFUL_ACCURACY))
        residual = own_residual(solver, problem, solution.impulses)
        if residual <= best:
            best, name = residual, problem.name
        if residual <= USEFUL_ACCURACY and solution.status is Status.SOLVED:
            return
    raise Violation(
        f"it solves none of {len(problems)} problems to {USEFUL_ACCURACY:g}; its best residual is {best:.1e}"
        f"{', on ' + name if name else ''}."
    )


def reports_infeasibility(solver: Solver) -> None:
    """A closing contact with a zero Delassus matrix is reported as INFEASIBLE, or is not supported."""
    problem = infeasible()
    if solver.supports(problem):
        return
    status = solution_of(solver, problem, DEFAULT_STOP).status
    if status is not Status.INFEASIBLE:
        raise Violation(
            f"a contact with G_ii = 0 and c_i < 0 has no solution, but the status is {status}; return "
            "Status.INFEASIBLE, or return a reason from supports."
        )


def zero_velocity_at_rest(solver: Solver) -> None:
    """With zero free velocity, the solution is exactly Λ = 0 with status SOLVED."""
    for problem in supported(solver, map(at_rest, (1, 2, 3)), "it supports none of the problems at rest"):
        solution = solution_of(solver, problem, DEFAULT_STOP)
        if solution.status is not Status.SOLVED or np.any(solution.impulses):
            raise Violation(
                f"with c = 0 on {problem.name} the status is {solution.status}, with impulses up to "
                f"{np.abs(solution.impulses).max():.1e} N s; return exact zeros and Status.SOLVED."
            )


def solves_no_contacts(solver: Solver) -> None:
    """A problem without contacts returns an empty array and SOLVED."""
    for problem in supported(solver, map(empty, (1, 3)), "it does not support problems without contacts"):
        status = solution_of(solver, problem, DEFAULT_STOP).status
        if status is not Status.SOLVED:
            raise Violation(
                f"for a problem without contacts, the status is {status}, with impulses of shape (0,); return an "
                "empty array and Status.SOLVED."
            )


@requires_iterates
@on_samples
def is_unaffected_by_observer(solver: Solver, problem: ContactProblem) -> None:
    """The observer is called once per iteration and does not influence the result."""
    unobserved = solution_of(solver, problem, DEFAULT_STOP)
    calls: list[tuple[int, FloatArray]] = []
    prepared = solver.prepare(problem)
    observed = prepared.solve(DEFAULT_STOP, observe=lambda number, impulses: calls.append((number, np.array(impulses))))
    iterations = [number for number, _ in calls]
    if iterations != list(range(1, observed.iterations + 1)):
        called = (
            f"{len(iterations)} times, with iterations {iterations[0]} to {iterations[-1]}" if iterations else "never"
        )
        raise Violation(
            f"on {problem.name} it took {observed.iterations} iterations and called its observer {called}; "
            "call observe(iteration, impulses) after each, from 1, or set has_iterates = False."
        )
    for _, impulses in calls:
        if impulses.shape != (problem.n_rows,):
            raise Violation(
                f"on {problem.name} it passed its observer impulses of shape {impulses.shape}, not (n_rows,)."
            )
    if not _have_equal_results(unobserved, observed):
        raise Violation(f"on {problem.name} the observed solve differs from the unobserved one; ignore the observer.")


@requires_iterates
def stops_at_solution(solver: Solver) -> None:
    """A solve that starts from its own solution converges within one iteration."""
    is_any_solved = False
    for problem in _supported(solver):
        prepared = solver.prepare(problem)
        solution = prepared.solve(DEFAULT_STOP)
        if solution.status is not Status.SOLVED:
            continue
        is_any_solved = True
        warm = prepared.solve(DEFAULT_STOP, start=solution.impulses.copy())
        if warm.status is not Status.SOLVED or warm.iterations > 1:
            raise Violation(
                f"started from its own solution of {problem.name}, the status is {warm.status} after "
                f"{warm.iterations} iterations; begin from start, and check the residual before the first iteration."
            )
    if not is_any_solved:
        raise NotApplicable(f"it solves no sample to {DEFAULT_STOP.tolerance:g}")


@on_samples
def obeys_iteration_limit(solver: Solver, problem: ContactProblem) -> None:
    """A solve takes at most max_iterations iterations."""
    for limit in (1, 5):
        iterations = solution_of(solver, problem, Stop(1e-300, limit, max_seconds=1.0)).iterations
        if iterations > limit:
            raise Violation(f"on {problem.name} it took {iterations} iterations, but max_iterations was {limit}.")


def obeys_time_limit(solver: Solver) -> None:
    """A solve returns within about max_seconds, whatever the tolerance and the iteration limit."""
    larger = random_contacts(60, 3)
    problem = _supported(solver)[0] if solver.supports(larger) else larger
    prepared, seconds = solver.prepare(problem), 0.1
    endless = Stop(1e-300, max_iterations=10**9, max_seconds=seconds)
    prepared.solve(endless)  # compilation and loading do not count
    start_time = time.perf_counter()
    solution = prepared.solve(endless)
    elapsed = time.perf_counter() - start_time
    if elapsed > seconds + SLACK_SECONDS:
        raise Violation(
            f"with max_seconds={seconds:g} it took {elapsed:.1f} s on {problem.name}, and the status is "
            f"{solution.status}; check the time once per iteration."
        )


def is_silent(solver: Solver) -> None:
    """A solve prints nothing and issues no warnings, neither in Python nor in native libraries."""
    problem = _supported(solver)[0]
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")  # also warnings that were shown in earlier tests
        printed = _captured_output(lambda: solution_of(solver, problem, DEFAULT_STOP)).strip()
    if warned:
        raise Violation(f"it issued the warning {str(warned[0].message)[:100]!r}; report it in Solution.message.")
    if printed:
        raise Violation(f"it printed {printed.splitlines()[0][:100]!r}; report it in Solution.message.")


BRIEF_CHECKS: tuple[Check[Solver], ...] = (
    *checks(
        interface=conforms_to_interface,
        pickling=can_be_pickled,
        process=has_no_side_effects,
        supports=declines_through_supports,
        finite=returns_finite_impulses,
        inputs_unchanged=leaves_inputs_unchanged,
        deterministic=is_deterministic,
        first_solve=solves_each_time,
        truthful=claims_truthfully,
        useful=is_useful,
        infeasible=reports_infeasibility,
        at_rest=zero_velocity_at_rest,
        no_contacts=solves_no_contacts,
        observed=is_unaffected_by_observer,
        warm_start=stops_at_solution,
        iteration_limit=obeys_iteration_limit,
        time_limit=obeys_time_limit,
        silent=is_silent,
    ),
    *INVARIANCE_CHECKS,
)
"""The tests of a solver that use small problems only."""

SOLVER_CHECKS: tuple[Check[Solver], ...] = (*BRIEF_CHECKS, *HARD_CHECKS)
"""All tests of a solver, in the order in which they run.

Side effects on the process are checked early: a later test could not detect a setting that an earlier one changed.
"""


def _supported(solver: Solver) -> list[ContactProblem]:
    """Return the samples that ``solver`` supports; raise ``Violation`` if it supports none."""
    try:
        return supported(solver)
    except NotApplicable:
        problems = samples()
        raise Violation(
            f"supports declines all {len(problems)} small problems, the first because {solver.supports(problems[0])}."
        ) from None


def _have_equal_results(first: Solution, second: Solution) -> bool:
    """Return whether two solves give identical results; True if either reached the time limit."""
    if Status.TIME_LIMIT in (first.status, second.status):
        return True
    return first.impulses.tobytes() == second.impulses.tobytes() and first.iterations == second.iterations


def _captured_output(function: Callable[[], object]) -> str:
    """Run ``function``; return its output on standard output and standard error, including that of native code."""
    try:
        sys.stdout.flush()
        sys.stderr.flush()
        originals = {stream: os.dup(stream) for stream in (1, 2)}
    except (OSError, ValueError, AttributeError):
        raise Violation("it closed standard output or standard error; leave them open.") from None
    printed = io.StringIO()  # Python's streams need not use the descriptors 1 and 2
    with tempfile.TemporaryFile() as file, redirect_stdout(printed), redirect_stderr(printed):
        try:
            for stream in originals:
                os.dup2(file.fileno(), stream)
            function()
        finally:
            ctypes.CDLL(None).fflush(None)
            for stream, copy in originals.items():
                os.dup2(copy, stream)
                os.close(copy)
        file.seek(0)
        return printed.getvalue() + file.read().decode(errors="replace")
