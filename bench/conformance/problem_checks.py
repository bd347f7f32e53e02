"""Tests of a problem of a plugin; each calls the function that makes the problem."""

import io
from collections.abc import Callable

from ...problems.contact.judge import judge
from ...problems.contact.problem import ContactProblem
from ...problems.exchange.files.problem_file import problem_bytes, read_problem
from .checks import Check, NotApplicable, Violation, checks

ANSWER_ACCURACY = 1e-6
"""The judged residual that impulses given as the answer must have."""

MakeProblem = Callable[[], ContactProblem]


def is_made(make: MakeProblem) -> None:
    """It can be made, and has contacts."""
    if make().n_rows == 0:
        raise Violation("it has no contacts, so every solver is done at once.")


def is_made_alike(make: MakeProblem) -> None:
    """Made twice it has the same numbers, so that runs compare like with like."""
    if make().digest != make().digest:
        raise Violation("made twice it has different numbers; draw chance from a fixed seed.")


def round_trips_through_file(make: MakeProblem) -> None:
    """Written and read again it has the same numbers: so it travels to the processes that solve it."""
    problem = make()
    if read_problem(io.BytesIO(problem_bytes(problem)), "the written problem").digest != problem.digest:
        raise Violation("written and read again it has different numbers.")


def answer_is_right(make: MakeProblem) -> None:
    """What it says about its solution, the judge confirms."""
    problem = make()
    answer = problem.answer
    if answer is None or (answer.solvable and not answer.impulses):
        raise NotApplicable("it gives no impulses as its answer")
    for index, impulses in enumerate(answer.impulses):
        residual = judge(problem, impulses).residual
        if answer.solvable and not residual <= ANSWER_ACCURACY:
            raise Violation(f"answer.impulses[{index}] is no solution: the judge reads {residual:.1e}.")
        if residual <= ANSWER_ACCURACY and not answer.solvable:
            raise Violation("it is said to have no solution, and gives one.")


PROBLEM_CHECKS: tuple[Check[MakeProblem], ...] = checks(
    made=is_made, deterministic=is_made_alike, file=round_trips_through_file, answer=answer_is_right
)
"""All tests of a problem."""
