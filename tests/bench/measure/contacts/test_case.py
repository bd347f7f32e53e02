"""A case repeats disturbed rounds, judges all answers, ends at its first failure, and verifies reported counts."""

from collections.abc import Sequence
from dataclasses import replace as spec_replace
from typing import Any

import msgspec
import numpy as np
import pytest
from cases_without_process import LADDER, PROBLEM, SOLUTION, made_case, measured_round, timed
from msgspec.structs import replace
from proxbench.bench.measure import ladder
from proxbench.bench.measure.contacts import case as case_module
from proxbench.bench.measure.contacts.case import (
    ENOUGH_SECONDS,
    MAX_EXCLUDED,
    MAX_EXCLUDED_SECONDS,
    MAX_RESTS,
    ROUNDS,
    Case,
)
from proxbench.bench.measure.ladder import MAX_DOUBTED_ROUNDS
from proxbench.bench.measure.measuring_core import MeasuringCore
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import Limits
from proxbench.bench.store.records import Curve, ObservedSolve, Point
from proxbench.problems import judge
from proxbench.solvers import Status, Stop
from stored_cases import measured_in, timed_round
from times_under_load import restore_limits


@pytest.fixture(autouse=True)
def _limits_of_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    restore_limits(
        monkeypatch,
        "measure.timed_round.TOLERATED_SECONDS",
        "measure.contacts.clock_account.ALLOWANCE_SECONDS",
        "store.notes.ALLOWANCE_SECONDS",
    )


def point(
    tolerance: float, outcome: Outcome = Outcome.SOLVED, status: str = "solved", excluded: str = "", passes: int = 1
) -> Point:
    rounds = [timed_round(number, 1e-3, excluded=excluded) for number in range(passes)]
    return Point(tolerance=tolerance, outcome=outcome, status=status, reason="", measured=measured_in(rounds))


SHORT, LONG = 0.5 * ENOUGH_SECONDS, ENOUGH_SECONDS


@pytest.mark.parametrize(
    ("rounds", "is_needed"),
    [
        ([(SHORT, "")], True),
        ([(SHORT, "")] * ROUNDS, False),
        ([(LONG, "")], False),
        ([(SHORT, "preempted")], True),
        ([(SHORT, "preempted"), (SHORT, "")], True),
        ([(SHORT, "preempted"), *[(SHORT, "")] * ROUNDS], False),
        ([(SHORT, "unsteady")] * (MAX_EXCLUDED - 1), True),
        ([(SHORT, "unsteady")] * MAX_EXCLUDED, False),
        ([(MAX_EXCLUDED_SECONDS, "preempted")], True),
        ([(1.01 * MAX_EXCLUDED_SECONDS, "preempted")], False),
        ([(0.6 * MAX_EXCLUDED_SECONDS, "preempted")] * 2, False),
    ],
)
def test_rounds_are_repeated_until_enough_count_or_too_many_are_excluded(
    rounds: list[tuple[float, str]], is_needed: bool
) -> None:
    assert made_case().needs_round([measured_round(*one) for one in rounds]) is is_needed


@pytest.mark.parametrize("excluded", ["", "preempted"])
def test_a_solve_that_fails_is_not_repeated(excluded: str) -> None:
    assert not made_case().needs_round([measured_round(SHORT, excluded, status=Status.STALLED)])


def test_a_pass_measures_points_that_are_missing_or_were_not_measured_in_it() -> None:
    solved = point(1e-2)
    assert [made_case(solved).is_pending(level) for level in range(3)] == [False, True, True]
    assert [made_case(solved, number=1).is_pending(level) for level in range(3)] == [True, True, True]
    assert not made_case(point(1e-2, passes=2), number=1).is_pending(0)


def test_failed_points_and_finer_ones_are_not_measured_again() -> None:
    rest = Point(tolerance=1e-4, outcome=Outcome.NOT_ATTEMPTED, status="", reason="0.01 already ended stalled")
    failed = made_case(point(1e-2, Outcome.STALLED, "stalled"), rest, number=1)
    assert [failed.is_pending(level) for level in range(2)] == [False, False]


def test_a_time_limit_caused_by_other_programs_is_retried_with_finer_points() -> None:
    late = point(1e-2, Outcome.TIME_LIMIT, "time limit", "preempted")
    rest = Point(tolerance=1e-4, outcome=Outcome.NOT_ATTEMPTED, status="", reason="")
    assert made_case(late, number=1).is_pending(0)
    assert not made_case(late, rest, number=1).is_pending(1)  # not before the coarser point is solved
    assert made_case(point(1e-2, passes=2), rest, number=1).is_pending(1)
    assert not made_case(point(1e-2, Outcome.TIME_LIMIT, "time limit"), number=1).is_pending(0)


@pytest.mark.parametrize(
    ("outcome", "status", "reason"),
    [
        (Outcome.SOLVED, "solved", ""),
        (Outcome.RELAXED, "solved", ""),
        (Outcome.WRONG, "solved", ""),
        (Outcome.TIME_LIMIT, "solved", "0.01 already ended time limit"),
        (Outcome.STALLED, "stalled", "0.01 already ended stalled"),
    ],
)
def test_finer_points_are_measured_only_after_a_claim_within_the_time_limit(
    outcome: Outcome, status: str, reason: str
) -> None:
    assert made_case().reason_to_stop(point(1e-2, outcome, status)) == reason


def test_a_point_holds_the_worst_of_all_answers_and_counts_them() -> None:
    worse = SOLUTION * (1.0 + 1e-6)
    found = made_case().point(1e-4, [measured_round(impulses=SOLUTION), measured_round(impulses=worse)])
    assert found.measured is not None
    assert found.measured.residual == judge(PROBLEM, worse).residual > judge(PROBLEM, SOLUTION).residual
    assert (found.outcome, found.measured.answers, len(set(found.measured.hashes))) == (Outcome.SOLVED, 2, 2)
    assert (found.reason, found.status, found.tolerance) == ("", "solved", 1e-4)
    assert made_case().point(1e-8, [measured_round(impulses=worse)]).outcome is Outcome.WRONG


def test_the_reason_of_a_failure_is_the_message_of_the_solver_or_else_a_sentence_on_its_status() -> None:
    silent, talking = (
        made_case().point(1e-4, [measured_round(status=Status.STALLED, message=message)]) for message in ("", "why")
    )
    assert silent.outcome is talking.outcome is Outcome.STALLED
    assert (silent.reason, talking.reason) == (Status.STALLED.sentence, "why")


def test_a_claim_after_the_time_limit_does_not_count_unless_the_rounds_are_excluded() -> None:
    limits = Limits(solve_seconds=0.01)
    slow, fast = measured_round(0.02), measured_round(0.005)
    late = made_case(limits=limits).point(1e-4, [slow])
    assert (late.outcome, late.reason) == (Outcome.TIME_LIMIT, "solved after 0.02 s, but its limit is 0.01 s")
    assert made_case(limits=limits).point(1e-4, [fast]).outcome is Outcome.SOLVED
    excluded = [measured_round(0.02, "preempted")] * 2
    assert made_case(limits=limits).point(1e-4, [*excluded, fast]).outcome is Outcome.SOLVED
    assert made_case(limits=limits).point(1e-4, excluded).is_late_under_load


class Scripted:
    """A process with given answers, processor time and number of started processes."""

    process, busy_seconds, peak_memory_bytes = 0, 1.5, 2**20

    def __init__(self, answers: dict[str, Any], worked: Sequence[float] = (), started: Sequence[int] = ()) -> None:
        silent = ({"iterations": [], "calls": 0, "claimed": 0}, np.zeros(0))
        self.answers, self.asked = {"observe": silent, **answers}, list[tuple[str, tuple[Any, ...]]]()
        self._worked, self._started = list(worked), list(started)

    def ask(self, request: str, *arguments: Any, largest: int = 0) -> tuple[dict[str, Any], bytes]:
        self.asked.append((request, arguments))
        answer, numbers = self.answers.get(request, ({}, np.zeros(0)))
        return answer, np.asarray(numbers, dtype=np.float64).tobytes()

    def processor_seconds(self) -> float:
        return self._worked.pop(0) if self._worked else 0.0

    def n_started(self) -> int:
        return self._started.pop(0) if self._started else 0

    def output(self) -> str:
        return "what it printed"

    def dismiss(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


def begun(monkeypatch: pytest.MonkeyPatch, process: Scripted) -> Case:
    """Return a case whose process is scripted, after its first requests."""
    monkeypatch.setattr(ladder, "Worker", lambda *setting: process)
    case = made_case()
    case.begin()
    return case


def answered(numbers: Any, **changes: Any) -> dict[str, Any]:
    """Return the answer to a request for a round of two solves, which take almost no time."""
    plain = {"answer_iterations": [5] * (len(numbers) // 3)}
    return {"round": (msgspec.to_builtins(timed(1e-9, 2, **{**plain, **changes})), numbers)}


@pytest.mark.parametrize(
    ("numbers", "count"),
    [(SOLUTION, 1), ([*SOLUTION, *SOLUTION], 2), (SOLUTION[:2], 0), ([0.0] * 9, 0), ([0.0] * 4, 0)],
)
def test_a_round_has_one_answer_of_all_rows_for_each_solve_at_most(
    numbers: Any, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = begun(monkeypatch, Scripted(answered(numbers)))
    found = case.measure(1e-4, 0)
    if count:
        assert found is not None
        assert found.impulses.shape == (count, 3)
    else:
        assert found is None
        assert case.outcome is Outcome.MISBEHAVED
        assert f"it returned {len(numbers)} numbers for 2 solves of 3 rows" in case.record().reason


@pytest.mark.parametrize("iterations", [[], [5], [5, 5, 5], [5, -1], "55"])
def test_a_round_without_the_iterations_of_each_answer_is_misbehaviour(
    iterations: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    process = Scripted(answered([*SOLUTION, *SOLUTION], answer_iterations=iterations))
    case = begun(monkeypatch, process)
    assert case.measure(1e-4, 0) is None
    assert case.outcome is Outcome.MISBEHAVED


@pytest.mark.parametrize("order", [1, -1])
def test_a_point_has_the_iterations_of_the_solve_whose_residual_it_has(order: int) -> None:
    rounds = [
        measured_round(impulses=SOLUTION, iterations=926),
        measured_round(impulses=SOLUTION * 1.01, iterations=26),
    ]
    found = made_case().point(1e-1, rounds[::order]).measured
    assert found is not None
    assert (found.residual, found.iterations) == (judge(PROBLEM, SOLUTION * 1.01).residual, 26)


@pytest.mark.parametrize(("named", "used"), [(None, 3), (1, 1), (2, 2), (5, 3)])
def test_threads_that_a_prepared_solver_names_are_recorded_beside_those_that_are_declared(
    named: int | None, used: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = begun(monkeypatch, Scripted(answered(SOLUTION, threads=named)))
    monkeypatch.setattr(case, "solver", spec_replace(case.solver, threads=3))
    assert case.record().threads_used == 0
    assert case.measure(1e-4, 0) is not None
    assert (case.record().threads, case.record().threads_used) == (3, used)


@pytest.mark.parametrize(("named", "outcome"), [(2, Outcome.MEASURED), (1, Outcome.MISBEHAVED)])
def test_a_solver_that_works_in_more_threads_than_it_names_misbehaves(
    named: int, outcome: Outcome, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its processor time is 1.5 ms in almost no wall time; each thread may use 1 ms."""
    case = begun(monkeypatch, Scripted(answered(SOLUTION, threads=named, processor=[0.75e-3] * 2)))
    monkeypatch.setattr(case, "solver", spec_replace(case.solver, threads=2))
    for name in ("pin", "has_pinned", "is_steady"):
        monkeypatch.setattr(MeasuringCore, name, lambda *_: True)
    monkeypatch.setattr(MeasuringCore, "probe", lambda *_: 0.0)
    case.pin_to_core(MeasuringCore(0, allowed=frozenset({0, 1})))
    case.measure(1e-4, 0)
    assert case.outcome is outcome
    if outcome is Outcome.MISBEHAVED:
        assert case.record().reason == "it takes more processor time than 1 thread could"


def test_a_round_is_asked_for_at_its_tolerance_within_the_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    process = Scripted(answered(SOLUTION))
    begun(monkeypatch, process).measure(1e-4, 0)
    (arguments,) = (arguments for request, arguments in process.asked if request == "round")
    assert arguments == (Stop(1e-4, Limits().max_iterations, Limits().solve_seconds), case_module.ROUND_SECONDS, None)


DISTURBED = [0.0, 10.0]
"""Processor time before and after a round that takes ten seconds of it, and nanoseconds by its own clock [s]."""


@pytest.mark.parametrize(
    ("rounds", "waited", "outcome"),
    [
        (MAX_DOUBTED_ROUNDS, 0.0, Outcome.MISBEHAVED),
        (MAX_DOUBTED_ROUNDS - 1, 0.0, Outcome.MEASURED),
        (MAX_DOUBTED_ROUNDS, 10.0, Outcome.MEASURED),
    ],
)
def test_work_that_its_clock_does_not_count_in_several_rounds_that_are_not_excluded_is_misbehaviour(
    rounds: int, waited: float, outcome: Outcome, monkeypatch: pytest.MonkeyPatch
) -> None:
    process = Scripted(answered(SOLUTION, waited=waited, involuntary=1), worked=DISTURBED * rounds)
    case = begun(monkeypatch, process)
    found = case.measure(1e-4, 0)
    assert case.outcome is outcome
    assert [request for request, _ in process.asked].count("round") == (1 if waited else MAX_DOUBTED_ROUNDS)
    if found is None:
        assert case.record().reason.startswith("its process worked for 10 s in rounds")
    else:
        assert np.array_equal(found.impulses[0], SOLUTION)


def test_a_second_round_with_work_that_its_clock_does_not_count_is_misbehaviour_at_any_point(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    process = Scripted(answered(SOLUTION), worked=[*DISTURBED, 0.0, 0.0, *DISTURBED])
    case = begun(monkeypatch, process)
    assert case.measure(1e-4, 0) is not None
    assert case.measure(1e-6, 0) is None
    assert case.outcome is Outcome.MISBEHAVED


def test_what_a_misbehaving_solver_measured_is_discarded_and_what_it_printed_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    case = begun(monkeypatch, Scripted(answered(np.zeros(2))))
    case.points = [point(1e-2)]
    case.measure(1e-4, 0)
    assert case.points == []
    assert case.record().stderr == "what it printed"
    honest = begun(monkeypatch, Scripted({}))
    honest.end()
    assert (honest.record().stderr, honest.record().wall_seconds) == ("", 1.5)


@pytest.mark.parametrize(("rests", "is_ended"), [(0, True), (3, True), (MAX_RESTS + 2, False)])
def test_processes_that_a_solver_starts_must_end_after_its_call(
    rests: int, is_ended: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    process = Scripted({}, started=[1] * rests)
    case = begun(monkeypatch, process)
    assert [request for request, _ in process.asked].count("rest") == min(rests, MAX_RESTS)
    assert (case.outcome is Outcome.MEASURED) is is_ended
    if not is_ended:
        assert case.record().reason == "it leaves 1 process running"


def test_the_answer_of_a_round_is_kept_while_its_processes_end(monkeypatch: pytest.MonkeyPatch) -> None:
    process = Scripted(answered(SOLUTION))
    case = begun(monkeypatch, process)
    process._started = [1, 1, 0]
    found = case.measure(1e-4, 0)
    assert found is not None
    assert found.impulses.tolist() == [SOLUTION.tolist()]
    assert [request for request, _ in process.asked][-2:] == ["rest", "rest"]


def test_a_solver_that_declines_gives_its_reason_and_is_asked_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    process = Scripted({"supports": ({"unsupported_reason": "no friction"}, [])})
    case = begun(monkeypatch, process)
    assert (case.outcome, case.record().reason) == (Outcome.UNSUPPORTED, "no friction")
    assert [request for request, _ in process.asked] == ["supports"]


def test_the_curve_has_the_judged_residual_of_each_iterate(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = np.array([np.zeros(3), 0.9 * SOLUTION, SOLUTION])
    process = Scripted({"observe": ({"iterations": [1, 2, 5], "calls": 5, "claimed": 5}, rows)})
    case = begun(monkeypatch, process)
    curve = case.record().curve
    assert curve.iteration == [1, 2, 5]
    assert curve.residual == [judge(PROBLEM, row).residual for row in rows]
    assert [request for request, _ in process.asked] == [
        "supports", "warm_up", "problem", "supports", "observe", "compare",
    ]  # fmt: skip
    (stop,) = (arguments[0] for request, arguments in process.asked if request == "observe")
    assert stop.tolerance == LADDER[-1]


@pytest.mark.parametrize(("iterations", "count"), [([1, 2], 3), ([1, 2, 3], 2), ("12", 2)])
def test_an_inconsistent_convergence_curve_is_misbehaviour(
    iterations: Any, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer = {"iterations": iterations, "calls": 2, "claimed": 2}
    case = begun(monkeypatch, Scripted({"observe": (answer, np.zeros(3 * count))}))
    assert case.outcome is Outcome.MISBEHAVED
    assert case.record().curve.iteration == []


@pytest.mark.parametrize(
    ("calls", "claimed", "reported", "iterations", "is_noted"),
    [
        (10, 5, 5, 10, True),
        (10, 0, 0, 10, True),
        (10, 5, 20, 20, True),
        (92, 926, 926, 926, True),
        (92, 926, 26, 26, True),
        (5, 5, 7, 7, False),
        (0, 5, 5, 5, False),
        (10, -5, 5, 5, False),
        (10, True, 5, 5, False),
    ],
)
def test_iterations_are_reported_or_observed_at_the_same_tolerance_but_never_scaled(
    calls: Any, claimed: Any, reported: int, iterations: int, is_noted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer = {"iterations": [1], "calls": calls, "claimed": claimed}
    process = Scripted({**answered(SOLUTION, answer_iterations=[reported]), "observe": (answer, SOLUTION)})
    case = begun(monkeypatch, process)
    rounds = [case.measure(1e-4, number) for number in range(2)]
    found = case.point(1e-4, [one for one in rounds if one is not None]).measured
    assert found is not None
    assert found.iterations == iterations
    assert found.claimed_iterations == (None if iterations == reported else reported)
    assert found.observed == (ObservedSolve(observed_iterates=calls, observed_iterations=claimed) if is_noted else None)
    stops = [arguments[0] for request, arguments in process.asked if request == "observe"]
    assert [stop.tolerance for stop in stops] == [LADDER[-1], *([1e-4] if is_noted else [])]


@pytest.mark.parametrize(
    "stored", [{"observed": ObservedSolve(observed_iterates=10, observed_iterations=5)}, {"claimed_iterations": 5}]
)
def test_a_solver_that_contradicted_itself_in_an_earlier_pass_is_observed_at_each_point(
    stored: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    known = replace(point(1e-2), measured=measured_in([timed_round(0, 1e-3)], **stored))
    answer = {"iterations": [1], "calls": 12, "claimed": 6}
    case = made_case(known)
    process = Scripted({**answered(SOLUTION, answer_iterations=[7]), "observe": (answer, SOLUTION)})
    monkeypatch.setattr(ladder, "Worker", lambda *setting: process)
    case._curve = Curve(iteration=[1], residual=[1.0])
    case.begin()
    one = case.measure(1e-4, 0)
    assert one is not None
    found = case.point(1e-4, [one]).measured
    assert found is not None
    assert (found.iterations, found.claimed_iterations) == (12, 7)


def test_a_solver_that_fails_when_it_is_observed_again_fails_the_case(monkeypatch: pytest.MonkeyPatch) -> None:
    answer = {"iterations": [1], "calls": 12, "claimed": 6}
    process = Scripted({**answered(SOLUTION), "observe": (answer, SOLUTION)})
    case = begun(monkeypatch, process)
    process.answers["observe"] = ({"unsupported_reason": 1}, [])
    assert case.measure(1e-4, 0) is None
    assert (case.outcome, case.points) == (Outcome.MISBEHAVED, [])
