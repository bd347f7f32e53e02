"""A local run visits every problem in every pass, reports each event once, and keeps finished results."""

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from proxbench.bench.measure.execution import local
from proxbench.bench.measure.execution.events import (
    CaseFinished,
    Event,
    PointFinished,
    ProblemPassFinished,
    ProblemStarted,
    RunStarted,
)
from proxbench.bench.measure.execution.local import LocalExecutor
from proxbench.bench.measure.ladder import LadderCase
from proxbench.bench.measure.machine import this_machine
from proxbench.bench.plugins.descriptions import solver_spec
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import PlanRecord
from proxbench.bench.store.records import CaseRecord, Point, RunRecord, Session
from proxbench.bench.store.store import Store
from proxbench.problems import load
from stored_cases import measured_in, timed_round

PROBLEMS, SOLVERS, TOLERANCES = ["hard-no-motion", "hard-groove"], ["SORprox", "NSGS"], [1e-2, 1e-4]
MACHINE = this_machine()
PLAN = PlanRecord(problems=PROBLEMS, solvers=SOLVERS, tolerances=TOLERANCES, passes=2)
RUN = RunRecord(run_id="run", plan=PLAN, machine=MACHINE, plugins=[])

Measure = Callable[..., None]


def round_of_each_level(cases: Sequence[LadderCase[Any]], keep: Any, core: Any) -> None:
    """Give each level of each case one more round, without measuring."""
    for case in cases:
        now = case.case_pass
        for level, tolerance in enumerate(case.ladder):
            before = case.points[level].rounds if level < len(case.points) else []
            measured = measured_in([*before, timed_round(now.number, 1e-3, session=now.session)])
            one = Point(tolerance=tolerance, outcome=Outcome.SOLVED, status="solved", reason="", measured=measured)
            case.points[level : level + 1] = [one]
            keep(case, tolerance)


@pytest.fixture
def visited(monkeypatch: pytest.MonkeyPatch) -> list[list[tuple[str, str]]]:
    """The problems and solvers of each visit, without measurements."""
    visits: list[list[tuple[str, str]]] = []

    def measure(cases: Sequence[LadderCase[Any]], keep: Any, core: Any) -> None:
        visits.append([(case.record().problem, case.record().solver) for case in cases])
        round_of_each_level(cases, keep, core)

    monkeypatch.setattr(local, "measure_ladder", measure)
    return visits


def execute(
    folder: Path, stored: Sequence[CaseRecord] = (), record: RunRecord = RUN, mix: bool = False
) -> tuple[Store, list[Event]]:
    """Execute the plan, and return the stored run and the events."""
    events: list[Event] = []
    store = Store.create(folder) if not folder.exists() else Store(folder)
    executor = LocalExecutor(list(map(solver_spec, SOLVERS)), store, record, events.append, mix)
    executor.execute({(case.problem, case.solver): case for case in stored})
    return store, events


def of_kind(events: list[Event], kind: type[Any]) -> list[Any]:
    return [event for event in events if isinstance(event, kind)]


def test_each_pass_visits_each_problem_with_all_solvers(visited: list[Any], tmp_path: Path) -> None:
    _, events = execute(tmp_path / "run")
    started = of_kind(events, ProblemStarted)
    assert [event.number for event in started] == [0, 0, 1, 1]
    assert Counter((event.problem, event.passes) for event in started) == {(name, 2): 2 for name in PROBLEMS}
    assert Counter(pair for visit in visited for pair in visit) == {
        (name, solver): 2 for name in PROBLEMS for solver in SOLVERS
    }


def test_progress_counts_cases_and_visits_up_to_their_totals(visited: list[Any], tmp_path: Path) -> None:
    _, events = execute(tmp_path / "run")
    assert events[0] == RunStarted(tmp_path / "run", total=4, done=0)
    assert [(event.done, event.total) for event in of_kind(events, ProblemPassFinished)] == [
        (number, 4) for number in (1, 2, 3, 4)
    ]
    finished = of_kind(events, CaseFinished)
    assert [(event.done, event.total) for event in finished] == [(number, 4) for number in (1, 2, 3, 4)]
    assert len({(event.problem, event.solver) for event in finished}) == 4
    points = Counter((event.problem, event.solver, event.tolerance) for event in of_kind(events, PointFinished))
    assert len(points) == 8
    assert set(points.values()) == {2}


def test_a_run_stores_its_cases_and_one_session_with_its_machine_core_and_load(
    visited: list[Any], tmp_path: Path
) -> None:
    store, _ = execute(tmp_path / "run")
    run, (cases, damaged) = store.read_run(), store.read_cases()
    assert (len(cases), damaged) == (4, [])
    assert all(case.is_finished(PLAN) for case in cases)
    (session,) = run.sessions
    loaded = session.machine.thread_pools
    assert session.machine == replace(this_machine(), thread_pools=loaded)  # libraries may be loaded meanwhile
    assert session.started <= session.finished
    assert len(session.busy_cores) == 4
    assert {one.session for case in cases for point in case.points for one in point.rounds} == {0}


def test_what_is_finished_is_not_measured_again(visited: list[Any], tmp_path: Path) -> None:
    store, _ = execute(tmp_path / "run")
    cases, _ = store.read_cases()
    visited.clear()
    _, events = execute(tmp_path / "run", cases, store.read_run())
    assert visited == []
    assert events == [RunStarted(tmp_path / "run", total=4, done=4)]
    _, events = execute(tmp_path / "run", cases[1:], store.read_run())
    missing = (cases[0].problem, cases[0].solver)
    assert visited == [[missing], [missing]]
    assert [(event.done, event.total) for event in of_kind(events, ProblemPassFinished)][-1] == (4, 4)
    assert [(one.problem, one.solver, one.done) for one in of_kind(events, CaseFinished)] == [(*missing, 4)]
    assert len(store.read_run().sessions) == 2


@pytest.mark.parametrize("changes", [{"digest": "0" * 64}, {"start": "0" * 16}])
def test_a_case_of_other_numbers_or_another_start_is_measured_again(
    changes: dict[str, str], visited: list[Any], tmp_path: Path
) -> None:
    store, _ = execute(tmp_path / "run")
    cases, _ = store.read_cases()
    visited.clear()
    execute(tmp_path / "run", [replace(cases[0], **changes), *cases[1:]], store.read_run())
    assert visited == [[(cases[0].problem, cases[0].solver)]] * 2


@pytest.mark.parametrize("mix", [False, True])
def test_a_problem_begun_on_another_machine_is_measured_anew_unless_machines_may_mix(
    mix: bool, visited: list[Any], tmp_path: Path
) -> None:
    store, _ = execute(tmp_path / "run")
    cases, _ = store.read_cases()
    elsewhere = Session(started="", machine=replace(MACHINE, host="elsewhere"))
    visited.clear()
    _, events = execute(tmp_path / "run", cases[1:], replace(RUN, sessions=[elsewhere]), mix)
    missing, whole = {(cases[0].problem, cases[0].solver)}, {(cases[0].problem, solver) for solver in SOLVERS}
    assert {pair for visit in visited for pair in visit} == (missing if mix else whole)
    assert events[0].done == 3


def test_failed_pass_keeps_earlier_measurements(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def interrupted(cases: Sequence[LadderCase[Any]], keep: Any, core: Any) -> None:
        round_of_each_level(cases[:1], lambda case, value: None, core)
        raise RuntimeError("no more")

    monkeypatch.setattr(local, "measure_ladder", interrupted)
    with pytest.raises(RuntimeError, match="no more"):
        execute(tmp_path / "run")
    cases, _ = Store.open(tmp_path / "run").read_cases()
    assert sorted(len(case.points) for case in cases) == [0, 2]


def test_a_claim_that_a_problem_has_no_solution_is_refuted_by_another_solver(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert load("hard-groove").answer is not None

    def claims(cases: Sequence[LadderCase[Any]], keep: Any, core: Any) -> None:
        round_of_each_level(cases, keep, core)
        for case in cases:
            if case.record().solver == "NSGS":
                case.points[0] = replace(case.points[0], outcome=Outcome.INFEASIBLE, status="infeasible")

    monkeypatch.setattr(local, "measure_ladder", claims)
    store, _ = execute(tmp_path / "run")
    outcomes = {(case.problem, case.solver): case.points[0].outcome for case in store.read_cases()[0]}
    assert outcomes["hard-groove", "NSGS"] is Outcome.WRONG
    assert outcomes["hard-groove", "SORprox"] is Outcome.SOLVED
