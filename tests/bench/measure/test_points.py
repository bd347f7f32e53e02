"""Points of several passes: the worse end and answer count, and limits that others caused are forgotten."""

import pytest
from proxbench.bench.measure.points import joined, marked, marked_together
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.records import Point, Round
from stored_cases import measured_in, timed_round


def one_round(number: int = 0, seconds: float = 1.0, cpu: float = 1.0) -> Round:
    return timed_round(number, seconds, cpu=cpu, repeats=2)


def point(
    one: Round, outcome: Outcome = Outcome.SOLVED, residual: float | None = 1e-7, answer: str = "a", reason: str = ""
) -> Point:
    measured = measured_in(
        [one], residual=residual, model_residual=residual, hashes=[answer], verdict={"residual": residual}
    )
    status = "solved" if outcome in (Outcome.SOLVED, Outcome.RELAXED, Outcome.WRONG) else outcome.value
    return Point(tolerance=1e-4, outcome=outcome, status=status, reason=reason, measured=measured)


@pytest.mark.parametrize("is_first", [True, False])
@pytest.mark.parametrize("worse", [Outcome.RELAXED, Outcome.TIME_LIMIT, Outcome.STALLED, Outcome.WRONG])
def test_the_worse_outcome_counts_whenever_it_comes(worse: Outcome, is_first: bool) -> None:
    good, bad = point(one_round(0)), point(one_round(1), worse, reason="why")
    found = joined(bad, good) if is_first else joined(good, bad)
    assert (found.outcome, found.reason) == (worse, "why")


@pytest.mark.parametrize("residual", [None, 1e-3])
def test_the_worse_answer_counts_with_its_verdict(residual: float | None) -> None:
    found = joined(point(one_round(0), residual=residual), point(one_round(1))).measured
    assert found is not None
    assert found.residual == found.model_residual == found.verdict["residual"] == residual


def test_times_are_those_of_all_rounds_and_answers_are_told_apart() -> None:
    found = point(one_round(0, 1.0))
    for number, (seconds, answer) in enumerate([(2.0, "a"), (6.0, "b")], 1):
        found = joined(found, point(one_round(number, seconds), answer=answer))
    assert found.measured is not None
    assert found.measured.total_seconds.median == 2.0
    assert (found.measured.repeats, found.measured.answers, found.measured.hashes) == (6, 2, ["a", "b"])


def test_a_round_that_others_disturbed_does_not_count() -> None:
    found = joined(joined(point(one_round(0)), point(one_round(1, 5.0, cpu=0.4))), point(one_round(2)))
    assert found.measured is not None
    assert [one.is_marred for one in found.rounds] == [False, True, False]
    assert found.measured.total_seconds.q3 == 1.0


def test_a_solver_that_always_waits_is_not_disturbed() -> None:
    assert not any(one.is_marred for one in marked([one_round(number, cpu=0.1) for number in range(3)]))


def test_a_point_is_disturbed_in_all_its_rounds_if_others_of_the_case_did_not_wait() -> None:
    waited, calm = (joined(point(one_round(0, cpu=cpu)), point(one_round(1, cpu=cpu))) for cpu in (0.5, 1.0))
    assert not any(one.is_marred for one in waited.rounds)
    assert [[one.is_marred for one in found.rounds] for found in marked_together([waited, calm])] == [
        [True] * 2,
        [False] * 2,
    ]
    assert marked_together([waited, waited]) == [waited, waited]


def test_a_time_limit_that_others_caused_is_forgotten() -> None:
    late = point(one_round(0, 9.0, cpu=0.5), Outcome.TIME_LIMIT)
    for found in (joined(late, point(one_round(1))), joined(point(one_round(1)), late)):
        assert found.outcome is Outcome.SOLVED
        assert found.measured is not None
        assert found.measured.total_seconds.q3 == 1.0
        assert sorted(one.is_marred for one in found.rounds) == [False, True]
    twice = joined(late, point(one_round(1, 9.0, cpu=0.5), Outcome.TIME_LIMIT))
    assert twice.is_marred
    assert twice.n_passes == 2
    by_itself = point(one_round(0, 9.0, cpu=0.98), Outcome.TIME_LIMIT)
    assert joined(by_itself, point(one_round(1))).outcome is Outcome.TIME_LIMIT
