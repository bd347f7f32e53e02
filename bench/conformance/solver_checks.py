"""The promises of a solver, each as a test on small problems.

A test looks at the problems that the solver says it ``supports``; one that supports none of them has nothing to show.
The tests on hard cases and on transformed problems have files of their own and join the list at the end of this one.
"""

import ctypes
import io
import os
import pickle
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...solvers.contract import form_fault, prepared_fault, reason_fault
from ...solvers.interface import Prepared, Solution, Solver, Status, Stop, shows_iterates
from ..store.outcome import WRONG_FACTOR
from .checks import Check, NotApplicable, Violation
from .hard_checks import HARD_CHECKS
from .invariance_checks import INVARIANCE_CHECKS
from .process_checks import PROCESS_CHECKS
from .samples import at_rest, empty, infeasible, random_contacts, samples
from .trial import expect_finite, expect_form, own_residual

ACCURACIES = (1e-2, 1e-4, 1e-6, 1e-8)
"""Tolerances at which claims are held to the judge."""

MODEST = Stop(1e-6, max_iterations=2000, max_seconds=1.0)
"""What tests ask for that are not about limits."""

USEFUL_ACCURACY = 1e-3
"""The judged residual, under its own model, that a solver must reach on some problem; Λ = 0 reaches it on none."""

SLACK_SECONDS = 1.0
"""What a solve may take beyond its time limit [s]: an iteration may have to end first."""


def keeps_to_interface(solver: Solver) -> None:
    """Name, model, ``supports``, ``prepare`` and ``solve`` are what the interface says."""
    fault = form_fault(solver)
    if not fault:
        problem = _supported(solver)[0]
        fault = prepared_fault(solver.prepare(problem))
    if fault:
        raise Violation(f"{fault}.")


def travels(solver: Solver) -> None:
    """It can be sent to another process, where every case runs."""
    try:
        name = pickle.loads(pickle.dumps(solver)).name
    except Exception as error:
        remedy = "hold plain options only, and define its class in a module"
        raise Violation(f"it cannot be pickled: {error}; {remedy}.") from error
    if name != solver.name:
        raise Violation(f"pickled and unpickled, {solver.name!r} calls itself {name!r}; pickle all its options.")


def refuses_through_supports(solver: Solver) -> None:
    """``supports`` says None or a reason in words, always the same, and what it lets through is solved."""
    for problem in samples():
        fault = reason_fault(solver.supports(problem))
        if fault:
            raise Violation(f"on {problem.name}: {fault}.")
        answers = {solver.supports(problem.fresh()) is None for _ in range(3)}
        if len(answers) > 1:
            raise Violation(
                f"its supports answers otherwise the second time on {problem.name}; let nothing but the problem decide."
            )
    for problem in _supported(solver):
        status = _solve(solver, problem, MODEST).status
        if status is Status.UNSUPPORTED:
            raise Violation(
                f"it ends {problem.name} as unsupported, though its supports returned None; let supports say why not."
            )


def returns_finite_impulses(solver: Solver) -> None:
    """Whatever the status, the impulses are finite floats of shape (n_rows,)."""
    for problem in _supported(solver):
        for stop in (MODEST, Stop(1e-300, max_iterations=3, max_seconds=1.0)):
            expect_finite(problem, _solve(solver, problem, stop))


def leaves_inputs_untouched(solver: Solver) -> None:
    """Neither the problem nor the start is written to."""
    for problem in _supported(solver):
        digest, start = problem.fresh().digest, np.full(problem.n_rows, 0.1)
        _prepared(solver, problem).solve(MODEST, start=start)
        if problem.fresh().digest != digest:
            raise Violation(f"it changed the numbers of {problem.name}; copy what it writes to.")
        if not np.array_equal(start, np.full(problem.n_rows, 0.1)):
            raise Violation(f"it changed the start it was given on {problem.name}; copy it first.")


def is_deterministic(solver: Solver) -> None:
    """Solving again, prepared again or not, ends in the same bits, and leaves earlier results alone."""
    for problem in _supported(solver):
        prepared = _prepared(solver, problem)
        first = prepared.solve(MODEST)
        kept = first.impulses.copy()
        again, anew = prepared.solve(MODEST), _solve(solver, problem.fresh(), MODEST)
        if not np.array_equal(kept, first.impulses, equal_nan=True):
            raise Violation(f"a second solve of {problem.name} changed the impulses returned by the first; copy them.")
        for how, other in (("the same prepared problem", again), ("a problem prepared anew", anew)):
            if Status.TIME_LIMIT in (first.status, other.status):
                continue
            if other.impulses.tobytes() != kept.tobytes() or other.iterations != first.iterations:
                raise Violation(
                    f"two solves of {problem.name} differ by up to {np.abs(other.impulses - kept).max():.1e} N s "
                    f"({first.iterations} and {other.iterations} iterations), the second on {how}; let none depend on "
                    "another, on chance or on time."
                )


def claims_truthfully(solver: Solver) -> None:
    """SOLVED is said only where the judge of the solver's own model reads at most ten times the tolerance."""
    for problem in _supported(solver):
        for tolerance in ACCURACIES:
            solution = _solve(solver, problem, Stop(tolerance, MODEST.max_iterations, MODEST.max_seconds))
            if solution.status is Status.SOLVED:
                residual = own_residual(solver, problem, solution.impulses)
                if not residual <= WRONG_FACTOR * tolerance:
                    raise Violation(
                        f"it claims to have solved {problem.name} to {tolerance:g}, but the judge of its model "
                        f"({solver.model}) reads {residual:.1e}; stop on the judge's residual."
                    )


def is_useful(solver: Solver) -> None:
    """At least one problem is solved to a residual of 1e-3 in the solver's own model."""
    best, name = np.inf, ""
    for problem in _supported(solver):
        solution = _solve(solver, problem, Stop(USEFUL_ACCURACY, MODEST.max_iterations, MODEST.max_seconds))
        residual = own_residual(solver, problem, solution.impulses)
        if residual <= best:
            best, name = residual, problem.name
        if residual <= USEFUL_ACCURACY and solution.status is Status.SOLVED:
            return
    raise Violation(
        f"it solves none of {len(_supported(solver))} problems to {USEFUL_ACCURACY:g}; its best residual is {best:.1e}"
        f"{', on ' + name if name else ''}."
    )


def reports_infeasibility(solver: Solver) -> None:
    """A contact that nothing can move, closing all the same, ends INFEASIBLE, or is refused by ``supports``."""
    problem = infeasible()
    if solver.supports(problem):
        return
    status = _solve(solver, problem, MODEST).status
    if status is not Status.INFEASIBLE:
        raise Violation(
            f"a contact with G_ii = 0 and c_i < 0 has no solution, and ends as {status}; return Status.INFEASIBLE, or "
            "let supports refuse it."
        )


def rests_at_rest(solver: Solver) -> None:
    """Zero free velocity needs no impulse: Λ = 0 exactly, SOLVED."""
    seen = [problem for problem in (at_rest(1), at_rest(2), at_rest(3)) if not solver.supports(problem)]
    for problem in seen:
        solution = _solve(solver, problem, MODEST)
        if solution.status is not Status.SOLVED or np.any(solution.impulses):
            largest = np.abs(solution.impulses).max()
            raise Violation(
                f"with c = 0 on {problem.name} it ends as {solution.status} with impulses up to {largest:.1e} N s; "
                "return exact zeros, solved."
            )
    if not seen:
        raise NotApplicable("it supports none of the problems at rest")


def ends_alike_when_observed(solver: Solver) -> None:
    """An observed solve ends in the same bits as an unobserved one, and the observer is called once per iteration."""
    _needs_iterates(solver)
    for problem in _supported(solver):
        unseen = _solve(solver, problem, MODEST)
        calls: list[tuple[int, FloatArray]] = []

        def observe(iteration: int, impulses: FloatArray, calls: list[tuple[int, FloatArray]] = calls) -> None:
            calls.append((iteration, np.array(impulses)))

        observed = _prepared(solver, problem).solve(MODEST, observe=observe)
        numbers = [number for number, _ in calls]
        if numbers != list(range(1, observed.iterations + 1)):
            raise Violation(
                f"on {problem.name} it did {observed.iterations} iterations and called its observer {_calls(numbers)}; "
                "call observe(iteration, impulses) after each, from 1, or set has_iterates = False."
            )
        wrong = next((shown.shape for _, shown in calls if shown.shape != (problem.n_rows,)), None)
        if wrong is not None:
            raise Violation(f"on {problem.name} it showed its observer impulses of shape {wrong}, not a row each.")
        if Status.TIME_LIMIT not in (unseen.status, observed.status) and (
            unseen.impulses.tobytes() != observed.impulses.tobytes() or unseen.iterations != observed.iterations
        ):
            raise Violation(f"on {problem.name} the observed solve ends otherwise than the unobserved one.")


def stops_at_once_at_the_solution(solver: Solver) -> None:
    """Started at its own solution it is done, within one iteration."""
    _needs_iterates(solver)
    tried = 0
    for problem in _supported(solver):
        prepared = _prepared(solver, problem)
        solution = prepared.solve(MODEST)
        if solution.status is not Status.SOLVED:
            continue
        tried += 1
        warm = prepared.solve(MODEST, start=solution.impulses.copy())
        if warm.status is not Status.SOLVED or warm.iterations > 1:
            raise Violation(
                f"started at its own solution of {problem.name} it ends as {warm.status} after {warm.iterations} "
                "iterations; begin from start, and look at the residual before the first iteration."
            )
    if not tried:
        raise NotApplicable(f"it solves no sample to {MODEST.tolerance:g}")


def obeys_iteration_limit(solver: Solver) -> None:
    """No more than max_iterations are done."""
    for problem in _supported(solver):
        for limit in (1, 5):
            solution = _solve(solver, problem, Stop(1e-300, limit, max_seconds=1.0))
            if solution.iterations > limit:
                raise Violation(
                    f"on {problem.name} it did {solution.iterations} iterations where {limit} were allowed."
                )


def obeys_time_limit(solver: Solver) -> None:
    """A solve ends about max_seconds after it began, whatever the tolerance and the number of iterations."""
    larger = random_contacts(60, 3)
    problem = _supported(solver)[0] if solver.supports(larger) else larger
    prepared, seconds = _prepared(solver, problem), 0.1
    endless = Stop(1e-300, max_iterations=10**9, max_seconds=seconds)
    prepared.solve(endless)  # whatever is compiled or loaded on the way is not meant
    began = time.perf_counter()
    solution = prepared.solve(endless)
    took = time.perf_counter() - began
    if took > seconds + SLACK_SECONDS:
        raise Violation(
            f"with max_seconds={seconds:g} it took {took:.1f} s on {problem.name} and ended as {solution.status}; look "
            "at the clock once per iteration."
        )


def is_silent(solver: Solver) -> None:
    """Nothing is printed or warned of, by Python or by a library below it."""
    problem = _supported(solver)[0]
    with _captured() as read, warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")  # also those that were shown before, in other tests
        _solve(solver, problem, MODEST)
    said = read().strip()
    if warned:
        raise Violation(f"it warned of {str(warned[0].message)[:100]!r}; say it in Solution.message.")
    if said:
        raise Violation(f"it printed {said.splitlines()[0][:100]!r}; say it in Solution.message.")


def solves_no_contacts(solver: Solver) -> None:
    """A problem without contacts is solved, with no impulses."""
    seen = [problem for problem in (empty(1), empty(3)) if not solver.supports(problem)]
    for problem in seen:
        solution = _solve(solver, problem, MODEST)
        if solution.status is not Status.SOLVED or np.shape(solution.impulses) != (0,):
            raise Violation(
                f"a problem without contacts ends as {solution.status} with impulses of shape "
                f"{np.shape(solution.impulses)}; return an empty array, solved."
            )
    if not seen:
        raise NotApplicable("it does not support problems without contacts")


def _check(name: str, test: object) -> Check[Solver]:
    assert callable(test)
    return Check(name, (test.__doc__ or "").strip(), test)


SOLVER_CHECKS: tuple[Check[Solver], ...] = (
    _check("interface", keeps_to_interface),
    _check("travels", travels),
    *PROCESS_CHECKS,
    _check("supports", refuses_through_supports),
    _check("finite", returns_finite_impulses),
    _check("inputs untouched", leaves_inputs_untouched),
    _check("deterministic", is_deterministic),
    _check("truthful", claims_truthfully),
    _check("useful", is_useful),
    _check("infeasible", reports_infeasibility),
    _check("at rest", rests_at_rest),
    _check("no contacts", solves_no_contacts),
    _check("observed", ends_alike_when_observed),
    _check("warm start", stops_at_once_at_the_solution),
    _check("iteration limit", obeys_iteration_limit),
    _check("time limit", obeys_time_limit),
    _check("silent", is_silent),
    *INVARIANCE_CHECKS,
    *HARD_CHECKS,
)
"""All tests of a solver, in the order in which they are best read and run.

What a solver does to its process is looked at before other tests let it: what is changed once cannot be changed again.
"""


def _supported(solver: Solver) -> list[ContactProblem]:
    """Return the samples that ``solver`` supports."""
    found = [problem for problem in samples() if solver.supports(problem) is None]
    if not found:
        reason = solver.supports(samples()[0])
        raise Violation(f"its supports refuses all {len(samples())} small problems, the first because {reason}.")
    return found


def _prepared(solver: Solver, problem: ContactProblem) -> Prepared:
    return solver.prepare(problem)


def _solve(solver: Solver, problem: ContactProblem, stop: Stop) -> Solution:
    solution = _prepared(solver, problem).solve(stop)
    expect_form(problem, solution)
    return solution


def _needs_iterates(solver: Solver) -> None:
    if not shows_iterates(solver):
        raise NotApplicable("it has no iterates to show (has_iterates is False)")


def _calls(numbers: list[int]) -> str:
    if not numbers:
        return "never"
    return f"{len(numbers)} times, with iterations {numbers[0]} to {numbers[-1]}"


@contextmanager
def _captured() -> Iterator["_Reader"]:
    """Catch all that this process writes to standard output and standard error, also below Python."""
    try:
        sys.stdout.flush()
        sys.stderr.flush()
        kept = os.dup(1), os.dup(2)
    except (OSError, ValueError, AttributeError):
        raise Violation("it closed standard output or standard error; leave them open.") from None
    printed = io.StringIO()  # Python's own streams need not lead to the descriptors 1 and 2
    with tempfile.TemporaryFile() as file, redirect_stdout(printed), redirect_stderr(printed):
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
        reader = _Reader()
        try:
            yield reader
        finally:
            ctypes.CDLL(None).fflush(None)
            os.dup2(kept[0], 1)
            os.dup2(kept[1], 2)
            os.close(kept[0])
            os.close(kept[1])
            file.seek(0)
            reader.text = printed.getvalue() + file.read().decode(errors="replace")


class _Reader:
    """What was captured, once the capturing has ended."""

    text = ""

    def __call__(self) -> str:
        return self.text
