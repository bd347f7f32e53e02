"""Notes on a row of a table, in addition to its numbers."""

from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from proxbench.bench.store.notes import (
    ALLOWANCE_SECONDS,
    EXPLAINED_RATIO,
    LOCAL_RATIO,
    is_explained,
    notes_of,
)
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.records import MAX_ANSWERS, ObservedSolve, Point
from proxbench.problems import ContactProblem, judge
from stored_cases import case_record, measured_in, timed_round
from times_under_load import restore_limits

FAST, FALL = 80.0, 0.005
"""Speed of a ball that touches a pile, and change of velocity by gravity in a step [m/s]."""


@pytest.fixture(autouse=True)
def _allowance_of_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    restore_limits(monkeypatch, "store.notes.ALLOWANCE_SECONDS")


def pile_under_a_fast_ball() -> ContactProblem:
    """Return three blocks on the ground, the top one touched by a light ball at 80 m/s."""
    directions = np.zeros((4, 4))
    for contact in range(4):
        directions[contact, contact] = 1.0
        if contact:
            directions[contact - 1, contact] = -1.0
    free = np.array([-FALL, 0.0, 0.0, -FAST])
    return ContactProblem.from_factors(directions, [1.0, 1.0, 1.0, 1e9], free, dim=1)


def point_of(problem: ContactProblem, impulses: np.ndarray) -> Point:
    verdict = judge(problem, impulses)
    numbers = {name: value for name, value in verdict.numeric_fields().items() if name != "residual"}
    measured = measured_in([timed_round(0, 1.0)], residual=verdict.residual, verdict=numbers)
    return Point(tolerance=1e-4, outcome=Outcome.SOLVED, reason="", status="solved", measured=measured)


def test_a_local_residual_far_above_the_judged_one_is_noted() -> None:
    problem = pile_under_a_fast_ball()
    impulses = np.array([0.0, 0.0, 0.0, FAST / (1e9 + 1.0)])
    verdict = judge(problem, impulses)
    assert verdict.residual <= 1e-4
    assert verdict.local_residual == pytest.approx(1.0, rel=1e-3)
    ratio = verdict.local_residual / verdict.residual
    assert notes_of(case_record(), point_of(problem, impulses)) == (
        f"the local residual is {ratio:.2g} times the judged one"
    )


def test_no_note_is_given_if_the_worst_contact_is_solved_too() -> None:
    problem = pile_under_a_fast_ball()
    impulses = np.linalg.solve(problem.delassus().toarray(), -problem.free_velocity)
    assert (impulses >= 0.0).all()
    assert notes_of(case_record(), point_of(problem, impulses)) == ""


@pytest.mark.parametrize(("local", "is_noted"), [(0.9 * LOCAL_RATIO, False), (1.1 * LOCAL_RATIO, True)])
@pytest.mark.parametrize(("residual", "is_above_rounding"), [(1e-7, True), (1e-16, False)])
def test_the_ratio_of_residuals_is_noted_only_above_rounding(
    local: float, is_noted: bool, residual: float, is_above_rounding: bool
) -> None:
    point = point_of(pile_under_a_fast_ball(), np.zeros(4))
    assert point.measured is not None
    verdict = {"local_residual": local * residual}
    measured = measured_in([timed_round(0, 1.0)], residual=residual, verdict=verdict)
    text = notes_of(
        case_record(), Point(tolerance=1e-4, outcome=Outcome.SOLVED, status="solved", reason="", measured=measured)
    )
    assert bool(text) is (is_noted and is_above_rounding)


def test_an_infinite_local_residual_is_noted() -> None:
    measured = measured_in([timed_round(0, 1.0)], verdict={"local_residual": None})
    text = notes_of(
        case_record(), Point(tolerance=1e-4, outcome=Outcome.SOLVED, status="solved", reason="", measured=measured)
    )
    assert text == "the local residual is inf times the judged one"


def test_a_local_residual_beside_a_judged_one_of_zero_is_noted_without_a_ratio() -> None:
    measured = measured_in([timed_round(0, 1.0)], residual=0.0, verdict={"local_residual": 0.5})
    point = Point(tolerance=1e-4, outcome=Outcome.SOLVED, status="solved", reason="", measured=measured)
    assert notes_of(case_record(), point) == "the local residual is 0.5, the judged one 0"


def note(is_randomised: bool = False, excluded: tuple[str, ...] = ("",), slowest: float = 1.0, **measured: Any) -> str:
    """Return the notes on a point with a round for each entry of ``excluded``, the reason of its exclusion or "".

    The repeated solves take 1 s, and ``slowest`` seconds in the last round.
    """
    times = [1.0] * (len(excluded) - 1) + [slowest]
    point = Point(
        tolerance=1e-4,
        outcome=Outcome.SOLVED,
        status="solved",
        reason="",
        measured=measured_in(
            [timed_round(0, t, excluded=why) for t, why in zip(times, excluded, strict=True)], **measured
        ),
    )
    return notes_of(case_record(is_randomised=is_randomised), point)


def test_times_of_the_library_call_alone_are_noted() -> None:
    rounds = [replace(timed_round(0, 1.0), uncounted_seconds=seconds) for seconds in (0.0, 1e-3)]
    whole, alone = (
        notes_of(case_record(), Point(tolerance=1e-4, outcome=Outcome.SOLVED, reason="", status="solved", measured=one))
        for one in (measured_in([rounds[0]]), measured_in(rounds))
    )
    assert whole == ""
    assert alone == "times are those of one call of the library, without preparation"


def test_longer_times_are_explained_up_to_a_ratio_plus_an_allowance() -> None:
    """The longest explained time is a multiple of the repeated one plus an allowance."""
    for repeated in (0.0, 1e-3, 10.0):
        longest = EXPLAINED_RATIO * repeated + ALLOWANCE_SECONDS
        assert is_explained(repeated, 0.999 * longest)
        assert not is_explained(repeated, 1.001 * longest)


def firsts(seconds: list[float], repeated: list[float], of: str = "first") -> dict[str, list[float]]:
    return {f"{of}_seconds": seconds, f"{of}_repeated_seconds": repeated}


def test_slow_first_solves_and_slow_copies_are_noted() -> None:
    slow = firsts([3.0, 9.0, 4.0], [1.0] * 3) | firsts([5.0, 2.0, 2.5], [1.0] * 3, of="copy")
    assert note(**slow) == (
        "first solves take at least 3 times as long as repeated ones; "
        "copies of the problem take at least 2 times as long as repeated ones"
    )
    assert note(**slow, excluded=("", "preempted", "unsteady")) == note(**slow)


def test_a_slow_excluded_round_explains_slow_first_solves_and_a_slow_other_one_does_not() -> None:
    """Excluded rounds show how slow the machine is; a solver could slow down any other round to hide the ratio."""
    slow = firsts([3.0, 9.0, 4.0], [1.0] * 3)
    assert note(**slow, excluded=("", "", "unsteady"), slowest=2.9) == ""
    assert note(**slow, excluded=("", "", ""), slowest=2.9) == note(**slow) != ""


def test_first_solves_are_not_noted_if_one_is_explained_or_if_there_are_few() -> None:
    explained = firsts([1.2, 9.0, 9.0], [1.0] * 3) | firsts([9.0, 9.0, 1.2], [1.0] * 3, of="copy")
    assert note(**explained) == ""
    assert note(**firsts([9.0, 9.0], [1.0] * 2)) == ""


def test_the_fastest_first_solve_is_compared_with_the_slowest_repeated_ones() -> None:
    """A core that is slow at times delays first and repeated solves, but not always both solves of a pair."""
    assert (
        note(**firsts([2.0, 2.0, 9.0], [0.5, 1.0, 1.5]))
        == "first solves take at least 1.3 times as long as repeated ones"
    )
    assert note(**firsts([9.0, 2.0, 3.0], [2.0, 1.0, 1.0])) == ""


def test_first_solves_that_were_stored_without_solves_beside_them_are_not_noted() -> None:
    assert note(first_seconds=[9.0, 9.0, 9.0], copy_seconds=[9.0, 9.0, 9.0]) == ""


@pytest.mark.parametrize(
    ("fields", "note"),
    [
        (
            {"observed": ObservedSolve(observed_iterates=92, observed_iterations=926)},
            "it reports 926 iterations of a solve that shows 92 iterates",
        ),
        (
            {"observed": ObservedSolve(observed_iterates=10, observed_iterations=1)},
            "it reports 1 iteration of a solve that shows 10 iterates",
        ),
        ({"claimed_iterations": 5}, "it reports 5 iterations, which an observed solve contradicts"),
        ({}, ""),
    ],
)
def test_iterations_that_an_observed_solve_contradicts_are_noted(fields: dict[str, Any], note: str) -> None:
    measured = measured_in([timed_round(0, 1.0)], **fields)
    point = Point(tolerance=1e-4, outcome=Outcome.SOLVED, status="solved", reason="", measured=measured)
    assert notes_of(case_record(), point) == note


def test_different_answers_are_noted_of_a_solver_that_does_not_draw_numbers() -> None:
    assert note(answers=2, repeats=5) == "2 different answers in 5 solves"
    assert note(answers=MAX_ANSWERS, repeats=9) == f"at least {MAX_ANSWERS} different answers in 9 solves"
    assert note(answers=1) == note(answers=2, is_randomised=True) == ""


@pytest.mark.parametrize("excluded", ["preempted", ""])
def test_time_limit_under_load_is_noted(excluded: str) -> None:
    measured = measured_in([timed_round(0, 1.0, excluded=excluded)], verdict={})
    point = Point(tolerance=1e-4, outcome=Outcome.TIME_LIMIT, reason="", status="time limit", measured=measured)
    words = "the time limit was reached while other programs used the core"
    assert notes_of(case_record(), point) == (words if excluded else "")
