"""First solves in fresh processes reveal what repeated solves hide, and processor times what the clock misses."""

import contextlib
import io
from collections.abc import Iterator, Sequence
from dataclasses import replace as spec_replace
from time import perf_counter
from typing import ClassVar

import numpy as np
import pytest
from habitual_solvers import STOP, Wrapped, directions
from msgspec.structs import replace
from proxbench.bench.isolation.worker import Fault
from proxbench.bench.measure.contacts import clock_account
from proxbench.bench.measure.contacts.case import warm_up_data
from proxbench.bench.measure.contacts.clock_account import (
    ALLOWANCE_SECONDS,
    HARNESS_FACTOR,
    ROUND_SECONDS,
    SHARE,
    ClockAccount,
)
from proxbench.bench.measure.contacts.control import Controls
from proxbench.bench.measure.measuring_core import MeasuringCore
from proxbench.bench.measure.timed_round import TimedRound
from proxbench.bench.plugins.descriptions import solver_spec
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import Limits
from proxbench.problems import ContactProblem, judge, load
from proxbench.problems.exchange.files.problem_file import read_problem
from proxbench.solvers import Status, Stop, create
from times_under_load import restore_limits

PROBLEM, SMALL = load("funnel-100"), load("hard-stack-10")
LIMITS = Limits(solve_seconds=30.0)
MICROSECOND = 1e-6


def repeated_seconds(solver: Wrapped) -> float:
    """Return the median time of solves that have loaded all kernels, in this process [s]."""
    ready, seconds = solver.prepare(PROBLEM), []
    for _ in range(9):
        began = perf_counter()
        ready.solve(STOP)
        seconds.append(perf_counter() - began)
    return float(np.median(seconds[1:]))


@pytest.fixture(autouse=True)
def _allowance_of_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    restore_limits(
        monkeypatch,
        "measure.contacts.control.MAX_ALLOWANCE_SECONDS",
        "measure.contacts.clock_account.ALLOWANCE_SECONDS",
        "store.notes.ALLOWANCE_SECONDS",
    )


@pytest.fixture
def controls(request: pytest.FixtureRequest) -> Iterator[Controls]:
    made = Controls(PROBLEM, warm_up_data(PROBLEM), solver_spec(request.param), LIMITS)
    yield made
    made.close()


@pytest.mark.slow
def test_a_solver_that_caches_solutions_misbehaves_and_both_times_are_given() -> None:
    problem = load("funnel-1000")  # ten milliseconds, far above any noise
    controls = Controls(problem, warm_up_data(problem), solver_spec(Wrapped("remember")), LIMITS)
    with contextlib.closing(controls), pytest.raises(Fault) as found:
        controls.first_solves(STOP, 8 * MICROSECOND, lambda: 8 * MICROSECOND)
    assert found.value.outcome is Outcome.MISBEHAVED
    assert "first solves to 1e-06, in fresh processes, take" in found.value.reason
    assert "repeated ones take 8e-06 s" in found.value.reason


@pytest.mark.slow
@pytest.mark.parametrize("controls", [Wrapped("compile")], indirect=True)
def test_compiling_during_a_first_solve_is_not_misbehaviour(controls: Controls) -> None:
    assert controls.first_solves(STOP, 1e-3, lambda: 1e-2)[-1].timed.status is Status.SOLVED


@pytest.mark.slow
@pytest.mark.parametrize("controls", [Wrapped("load", directions(PROBLEM))], indirect=True)
def test_loading_a_kernel_only_for_the_original_problem_is_not_misbehaviour(controls: Controls) -> None:
    solver = Wrapped("load", directions(PROBLEM))

    def again() -> float:
        return 2 * repeated_seconds(solver)  # a load takes much longer than two solves

    seconds = again()  # stores the kernel
    loading = controls.first_solves(STOP, 1.0, never)[-1].seconds
    found = controls.first_solves(STOP, seconds, again)
    assert np.median([solve.seconds for solve in found]) < 0.5 * loading


@pytest.mark.parametrize("controls", [Wrapped()], indirect=True)
def test_the_impulses_of_a_first_solve_are_those_of_the_problem(controls: Controls) -> None:
    expected = create("SORprox").prepare(PROBLEM).solve(STOP)
    for found in controls.first_solves(STOP, 1.0, never):  # each in its own fork
        assert found.impulses.tobytes() == expected.impulses.tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("controls", [Wrapped()], indirect=True)
def test_a_copy_is_solved_once_if_it_takes_about_as_long_as_the_problem(controls: Controls) -> None:
    assert len(controls.copies(STOP, 1.0, never)) == 1
    assert len(controls.copies(STOP, 1e-9, lambda: 1e-9)) > 1


def of_one_solve(seconds: float) -> TimedRound:
    return TimedRound(Status.SOLVED, 1, "", [0.0], [seconds], [seconds], 0, 0, 0.0)


def test_work_beyond_the_clock_of_the_process_is_a_fault() -> None:
    account = ClockAccount(PROBLEM)
    assert account.fault(of_one_solve(1.0), processor_seconds=1.0 + SHARE + ROUND_SECONDS) is None
    fault = account.fault(of_one_solve(0.0), processor_seconds=ALLOWANCE_SECONDS + 0.1)
    assert fault is not None
    assert "s in rounds, of which its own clock explains 1.0" in fault
    assert account.fault(of_one_solve(0.0), processor_seconds=ROUND_SECONDS) is None  # that round does not count


@pytest.mark.parametrize(("rounds", "solves", "harness"), [(1, 1, 0.0), (10, 1, 0.0), (10, 4, 0.01), (3, 50, 0.001)])
def test_each_round_and_each_fresh_problem_adds_to_the_allowed_work(
    rounds: int, solves: int, harness: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """W ≤ (1 + SHARE) P + HARNESS_FACTOR N h + n ROUND_SECONDS + ALLOWANCE_SECONDS with P = 0.1 N seconds."""
    monkeypatch.setattr(clock_account, "_harness_seconds", lambda problem: harness)
    timed = replace(of_one_solve(0.0), prepare=[0.0] * solves, solve=[0.1] * solves, processor=[0.1] * solves)
    n = rounds * solves
    largest = (1.0 + SHARE) * 0.1 * n + HARNESS_FACTOR * n * harness + rounds * ROUND_SECONDS + ALLOWANCE_SECONDS
    for worked, is_explained in ((largest - 1e-6, True), (largest + 1e-6, False)):
        account = ClockAccount(PROBLEM)
        for _ in range(rounds - 1):
            account.fault(timed, 0.0)
        assert (account.fault(timed, worked) is None) is is_explained


class Scripted(Controls):
    """First solves whose times are given: of the problem, and of the problem after another one."""

    solved: ClassVar[ContactProblem] = SMALL

    def __init__(self, fresh: list[float], after_another: float = 1.0, status: Status = Status.SOLVED) -> None:
        super().__init__(self.solved, b"", solver_spec(Wrapped()), LIMITS)
        self._loads_kernels = True  # no process solves, so that the fork server need not load all kernels
        self.fresh, self.after_another, self.status = fresh, after_another, status
        self.n_asked = 0

    def _ask(self, stop: Stop, problems: Sequence[bytes], start: np.ndarray | None) -> tuple[TimedRound, np.ndarray]:
        self.n_asked += 1
        seconds = self.after_another if len(problems) > 1 else self.fresh[min(self.n_asked, len(self.fresh)) - 1]
        return replace(of_one_solve(seconds), status=self.status), np.zeros(self.problem.n_rows)


class Noting(Scripted):
    """First solves that store their problem and start."""

    solved = PROBLEM

    def _ask(self, stop: Stop, problems: Sequence[bytes], start: np.ndarray | None) -> tuple[TimedRound, np.ndarray]:
        assert start is not None
        self.noted = [*getattr(self, "noted", []), (read_problem(io.BytesIO(problems[-1]), "one"), start)]
        return super()._ask(stop, problems, start)


def test_a_first_solve_in_other_units_starts_as_far_from_the_solution_as_the_timed_ones() -> None:
    """The residual of the judge depends on no unit, and another start would take other iterations."""
    start = create("SORprox").prepare(PROBLEM).solve(Stop(1e-2)).impulses
    controls = Noting([0.01])
    controls.first_solves(STOP, 0.01, never, start)
    assert all(one.digest != PROBLEM.digest for one, _ in controls.noted)
    found = [judge(one, own).residual for one, own in controls.noted]
    assert found == pytest.approx([judge(PROBLEM, start).residual] * 2, rel=1e-9)


@pytest.mark.parametrize(("seconds", "fresh", "n"), [(1.0, [1.0], 1), (0.01, [0.01], 2), (0.01, [0.1, 0.01], 4)])
def test_first_solves_are_repeated_until_explained_times_outnumber_others(
    seconds: float, fresh: list[float], n: int
) -> None:
    controls = Scripted(fresh)
    assert [one.seconds for one in controls.first_solves(STOP, seconds, lambda: seconds)][:1] == fresh[:1]
    assert controls.n_asked == n


@pytest.mark.slow
def test_only_slow_first_solves_and_slow_copies_are_compared_with_one_more_round() -> None:
    """One more round follows directly, because the machine may have become slower since."""
    again = iter([0.3, 0.002, 0.4])
    found = Scripted([0.1, 0.01, 0.3, 0.01, 0.01]).first_solves(STOP, 0.01, lambda: next(again))
    assert [(one.seconds, one.repeated) for one in found] == [(0.1, 0.3), (0.01, 0.01)]
    copies = Scripted([0.1], after_another=0.3).copies(STOP, 0.01, lambda: next(again))
    assert [(one.seconds, one.repeated) for one in copies] == [(0.1, 0.01), (0.3, 0.4)]


@pytest.mark.parametrize(("seconds", "loaded"), [(0.1, 0), (1e-4, 2)])
def test_kernels_are_loaded_only_after_slow_copies_that_may_have_compiled_some(
    seconds: float, loaded: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[None] = []
    monkeypatch.setattr(Controls, "_load_kernels", lambda _: calls.append(None))
    monkeypatch.setattr(MeasuringCore, "is_steady", lambda *_: False)  # requests more copies after explained ones too
    assert len(Scripted([0.1], after_another=0.1).copies(STOP, seconds, lambda: seconds)) == 6
    assert len(calls) == loaded


def test_slower_machine_causes_no_misbehaviour() -> None:
    assert Scripted([0.1], 0.1).first_solves(STOP, 0.001, lambda: 0.1)
    assert Scripted([0.1], 0.1).first_solves(STOP, 0.1 / 1.4, lambda: 0.001)
    with pytest.raises(Fault, match=r"take 0\.1 s and repeated ones take 0\.002 s"):
        Scripted([0.1], 0.1).first_solves(STOP, 0.001, lambda: 0.002)


def test_first_solves_under_load_cause_no_misbehaviour(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(MeasuringCore, "is_steady", lambda core, *probes: False)
    found = Scripted([0.1], 0.1).first_solves(STOP, 0.001, lambda: 0.001)
    assert not any(one.is_undisturbed for one in found)
    late = Scripted([1.0], status=Status.TIME_LIMIT).first_solves(STOP, 1e-3, never)
    assert not late[-1].is_undisturbed


def never() -> float:
    raise AssertionError


def test_the_faster_of_first_solves_with_and_without_a_prior_problem_count() -> None:
    assert [one.seconds for one in Scripted([0.1], 0.001).first_solves(STOP, 0.001, lambda: 0.001)] == [0.001] * 4
    assert {one.seconds for one in Scripted([0.0015], 0.1).first_solves(STOP, 0.001, lambda: 0.001)} == {0.0015}


class OtherWay(Scripted):
    """Solves of the problem that take ten iterations, copies that take ``of_copies``, and the time after variants."""

    def __init__(self, of_copies: int, after_variants: float) -> None:
        super().__init__([0.1], 0.1)
        self.of_copies, self.after_variants = of_copies, after_variants

    def _ask(self, stop: Stop, problems: Sequence[bytes], start: np.ndarray | None) -> tuple[TimedRound, np.ndarray]:
        timed, impulses = super()._ask(stop, problems, start)
        largest = [float(np.abs(read_problem(io.BytesIO(one), "one").free_velocity).max()) for one in problems]
        are_variants = all(np.log2(one / np.abs(SMALL.free_velocity).max()) % 1.0 == 0.0 for one in largest)
        if len(problems) > 1 and are_variants:
            timed = replace(timed, solve=[self.after_variants], processor=[self.after_variants])
        earlier = [10 if are_variants else self.of_copies] * (len(problems) - 1)
        return replace(timed, iterations=10, earlier_iterations=earlier), impulses


@pytest.mark.parametrize(("of_copies", "after_variants"), [(10, 1e-3), (12, 1e-3), (4, 0.1)])
def test_slow_first_solves_are_a_fault_after_equally_slow_copies_or_after_variants(
    of_copies: int, after_variants: float
) -> None:
    with pytest.raises(Fault, match=r"take 0\.1 s and repeated ones take 0\.001 s"):
        OtherWay(of_copies, after_variants).first_solves(STOP, 1e-3, lambda: 1e-3)


@pytest.mark.parametrize("of_copies", [4, 20])
def test_code_that_is_not_yet_loaded_in_first_solves_is_not_misbehaviour(of_copies: int) -> None:
    found = OtherWay(of_copies, 1e-3).first_solves(STOP, 1e-3, lambda: 1e-3)
    assert {solve.seconds for solve in found if solve.is_first} == {0.1}  # reported in a note
    assert {solve.seconds for solve in found if not solve.is_first} == {1e-3}  # these are judged


def test_single_slow_round_does_not_refute_stored_answers() -> None:
    again = iter([1e-3] * 5 + [0.1] + [1e-3] * 20)
    with pytest.raises(Fault, match=r"take 0\.1 s and repeated ones take 0\.001 s"):
        OtherWay(10, 1e-3).first_solves(STOP, 1e-3, lambda: next(again))


def test_a_repeated_time_of_zero_is_compared() -> None:
    with pytest.raises(Fault, match=r"take 0\.1 s"):
        OtherWay(10, 1e-3).first_solves(STOP, 0.0, lambda: 0.0)


def test_first_solves_that_reach_the_time_limit_are_repeated_in_own_units_and_misbehave_where_others_are_fast() -> None:
    late = Scripted([1.0], status=Status.TIME_LIMIT)
    assert [one.timed.status for one in late.first_solves(STOP, STOP.max_seconds, never)] == [Status.TIME_LIMIT]
    assert late.n_asked == 2
    with pytest.raises(Fault, match="reach the time limit"):
        late.first_solves(STOP, 1e-3, never)
    assert Scripted([1.0], status=Status.STALLED).first_solves(STOP, 1e-3, never)[-1].timed.status is Status.STALLED


def test_first_solves_have_as_many_cores_as_timed_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    pinned = list[int]()
    monkeypatch.setattr(MeasuringCore, "pin", lambda core, process, count=1: pinned.append(count))
    spec = spec_replace(solver_spec("SORprox"), threads=2)
    with contextlib.closing(Controls(PROBLEM, warm_up_data(PROBLEM), spec, LIMITS)) as controls:
        controls.first_solves(STOP, 1.0, never)
        controls.pin_to_core(MeasuringCore(0, allowed=frozenset({0, 1})))
    assert set(pinned) == {2}
