"""Points of several passes: the worse outcome and answer count, and limits due to excluded rounds are ignored."""

import pytest
from msgspec.structs import replace
from proxbench.bench.measure.points import joined
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.records import ObservedSolve, Point, Round
from stored_cases import measured_in, timed_round


def one_round(number: int = 0, seconds: float = 1.0, excluded: str = "") -> Round:
    return timed_round(number, seconds, repeats=2, excluded=excluded)


def point(
    one: Round,
    outcome: Outcome = Outcome.SOLVED,
    residual: float | None = 1e-7,
    answer: str = "a",
    reason: str = "",
    iterations: int = 3,
) -> Point:
    measured = measured_in(
        [one],
        residual=residual,
        model_residual=residual,
        hashes=[answer],
        verdict={"residual": residual},
        iterations=iterations,
    )
    status = "solved" if outcome in (Outcome.SOLVED, Outcome.RELAXED, Outcome.WRONG) else outcome.value
    return Point(tolerance=1e-4, outcome=outcome, status=status, reason=reason, measured=measured)


@pytest.mark.parametrize("is_first", [True, False])
@pytest.mark.parametrize("worse", [Outcome.RELAXED, Outcome.TIME_LIMIT, Outcome.STALLED, Outcome.WRONG])
def test_worse_outcome_prevails_in_either_order(worse: Outcome, is_first: bool) -> None:
    good, bad = point(one_round(0)), point(one_round(1), worse, reason="why")
    found = joined(bad, good) if is_first else joined(good, bad)
    assert (found.outcome, found.reason) == (worse, "why")


@pytest.mark.parametrize("residual", [None, 1e-3])
def test_the_worse_answer_counts_with_its_verdict(residual: float | None) -> None:
    found = joined(point(one_round(0), residual=residual), point(one_round(1))).measured
    assert found is not None
    assert found.residual == found.model_residual == found.verdict["residual"] == residual


@pytest.mark.parametrize("order", [1, -1])
def test_iterations_are_those_of_the_pass_with_the_worse_answer(order: int) -> None:
    passes = [point(one_round(0), residual=1e-3, iterations=26), point(one_round(1), iterations=926)][::order]
    found = joined(*passes).measured
    assert found is not None
    assert (found.residual, found.iterations) == (1e-3, 26)


@pytest.mark.parametrize("order", [1, -1])
def test_an_observed_solve_that_contradicts_itself_is_kept(order: int) -> None:
    observed = ObservedSolve(observed_iterates=92, observed_iterations=926)
    known = point(one_round(0))
    assert known.measured is not None
    passes = [replace(known, measured=replace(known.measured, observed=observed)), point(one_round(1))][::order]
    found = joined(*passes).measured
    assert found is not None
    assert found.observed == observed


def test_times_cover_all_rounds_and_distinct_answers_are_counted() -> None:
    found = point(one_round(0, 1.0))
    for number, (seconds, answer) in enumerate([(2.0, "a"), (6.0, "b")], 1):
        found = joined(found, point(one_round(number, seconds), answer=answer))
    assert found.measured is not None
    assert found.measured.total_seconds.median == 2.0
    assert (found.measured.repeats, found.measured.answers, found.measured.hashes) == (6, 2, ["a", "b"])


def test_an_excluded_round_does_not_count() -> None:
    found = joined(joined(point(one_round(0)), point(one_round(1, 5.0, "preempted"))), point(one_round(2)))
    assert found.measured is not None
    assert [one.excluded for one in found.rounds] == ["", "preempted", ""]
    assert found.measured.total_seconds.q3 == 1.0
    assert not found.measured.is_excluded


def test_point_with_only_excluded_rounds_keeps_their_times_and_is_excluded() -> None:
    found = joined(point(one_round(0, 5.0, "preempted")), point(one_round(1, 7.0, "unsteady"))).measured
    assert found is not None
    assert found.total_seconds.median == 6.0
    assert found.is_excluded


def test_a_time_limit_that_excluded_rounds_caused_is_forgotten() -> None:
    late = point(one_round(0, 9.0, "preempted"), Outcome.TIME_LIMIT)
    for found in (joined(late, point(one_round(1))), joined(point(one_round(1)), late)):
        assert found.outcome is Outcome.SOLVED
        assert found.measured is not None
        assert found.measured.total_seconds.q3 == 1.0
        assert sorted(one.excluded for one in found.rounds) == ["", "preempted"]
    twice = joined(late, point(one_round(1, 9.0, "preempted"), Outcome.TIME_LIMIT))
    assert twice.is_late_under_load
    assert twice.n_passes == 2
    by_itself = point(one_round(0, 9.0), Outcome.TIME_LIMIT)
    assert joined(by_itself, point(one_round(1))).outcome is Outcome.TIME_LIMIT


def test_passes_are_counted_in_each_session_of_a_run() -> None:
    rounds = [
        timed_round(0, 1.0),
        timed_round(0, 1.0, turn=1),
        timed_round(1, 1.0),
        timed_round(0, 1.0, session=1),
        timed_round(0, 1.0, session=1, turn=1),
    ]
    for kept, n_passes in ((rounds[:2], 1), (rounds[:3], 2), (rounds, 3), ([rounds[0], rounds[3]], 2)):
        found = Point(tolerance=1e-4, outcome=Outcome.SOLVED, status="solved", reason="", measured=measured_in(kept))
        assert found.n_passes == n_passes


@pytest.mark.parametrize(("excluded", "is_late"), [(["preempted", ""], False), (["preempted", "unsteady"], True)])
def test_a_time_limit_is_attributed_to_other_programs_only_if_all_rounds_are_excluded(
    excluded: list[str], is_late: bool
) -> None:
    rounds = [timed_round(number, 9.0, excluded=why) for number, why in enumerate(excluded)]
    found = Point(
        tolerance=1e-4, outcome=Outcome.TIME_LIMIT, status="time limit", reason="", measured=measured_in(rounds)
    )
    assert found.is_late_under_load is is_late
    assert not found.is_repeated
