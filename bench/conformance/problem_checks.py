"""Tests of a problem of a plugin; each calls the function that creates the problem."""

import io
from collections.abc import Callable

from ...problems.contact.judge import judge
from ...problems.contact.problem import ContactProblem
from ...problems.exchange.files.problem_file import problem_bytes, read_problem
from .checks import Check, NotApplicable, Violation, checks

ANSWER_ACCURACY = 1e-6
"""Largest judged residual of impulses given as the answer."""

MakeProblem = Callable[[], ContactProblem]


def can_be_created(make: MakeProblem) -> None:
    """The problem can be created, and has contacts."""
    if make().n_rows == 0:
        raise Violation("it has no contacts; add at least one.")


def is_deterministic(make: MakeProblem) -> None:
    """Creating the problem twice gives identical data, so that runs are comparable."""
    if make().digest != make().digest:
        raise Violation("creating it twice gives different data; use a fixed random seed.")


def round_trips_through_file(make: MakeProblem) -> None:
    """Writing and reading the problem preserves its data; solver processes receive it as a file."""
    problem = make()
    if read_problem(io.BytesIO(problem_bytes(problem)), "the written problem").digest != problem.digest:
        raise Violation("writing and reading it changes its data.")


def answer_is_right(make: MakeProblem) -> None:
    """The judge confirms the answer of the problem."""
    problem = make()
    answer = problem.answer
    if answer is None or (answer.solvable and not answer.impulses):
        raise NotApplicable("its answer has no impulses")
    for index, impulses in enumerate(answer.impulses):
        residual = judge(problem, impulses).residual
        if answer.solvable and not residual <= ANSWER_ACCURACY:
            raise Violation(f"answer.impulses[{index}] is not a solution: its judged residual is {residual:.1e}.")
        if residual <= ANSWER_ACCURACY and not answer.solvable:
            raise Violation("it is declared unsolvable, but has a solution.")


PROBLEM_CHECKS: tuple[Check[MakeProblem], ...] = checks(
    made=can_be_created, deterministic=is_deterministic, file=round_trips_through_file, answer=answer_is_right
)
"""All tests of a problem."""
