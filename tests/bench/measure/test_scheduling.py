"""Each pass has its own order, and each point has a round in each pass."""

import pytest
from crashing_solver import CrashingBelow
from msgspec.structs import replace
from proxbench.bench import Run, load, resume, run
from proxbench.bench.errors import BenchError
from proxbench.bench.measure.execution.events import Event, ProblemStarted
from proxbench.bench.measure.execution.run_executor import shuffled
from proxbench.bench.store.condition import warnings
from proxbench.bench.store.frames import rounds_frame
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import PASSES, Limits, PlanRecord
from proxbench.bench.store.ratios import ratio, times_by_point
from proxbench.bench.store.records import CaseRecord, Point
from proxbench.bench.store.store import Store
from stored_cases import case_record, measured_in, timed_round

PLAN = PlanRecord(problems=["p"], solvers=["fast", "slow", "noisy"], tolerances=[1e-2, 1e-4], limits=Limits())


def case(solver: str, *levels: list[float]) -> CaseRecord:
    """Return a case whose points have these times of rounds."""
    points = []
    for tolerance, seconds in zip(PLAN.tolerances, levels, strict=True):
        rounds = [timed_round(number, value) for number, value in enumerate(seconds)]
        measured = measured_in(rounds, residual=tolerance, model_residual=tolerance)
        points.append(Point(tolerance=tolerance, outcome=Outcome.SOLVED, status="solved", reason="", measured=measured))
    return case_record(solver=solver, points=points)


STEADY = [0.1, 0.1, 0.1, 0.1, 0.1]


def test_each_pass_has_an_order_of_its_own_that_a_seed_gives_again() -> None:
    items = list(range(20))
    orders = [tuple(shuffled(items, 7, number)) for number in range(5)]
    assert len(set(orders)) == 5
    assert all(sorted(order) == items for order in orders)
    assert orders == [tuple(shuffled(items, 7, number)) for number in range(5)]


@pytest.fixture(scope="module")
def events() -> list[Event]:
    return []


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, events: list[Event]) -> Run:
    problems = ["hard-no-motion", "hard-tresca-joint", "hard-sticking-box", "hard-counterexample"]
    return run(
        problems, ["SORprox", "NSGS"], results=tmp_path_factory.mktemp("r"), tolerances=1e-4, on_event=events.append
    )


@pytest.mark.slow
def test_every_solved_point_has_a_round_in_every_pass(made: Run) -> None:
    failed = made.cases.query("outcome != 'measured'")
    assert failed.empty, [*failed["reason"]]
    solved = made.points.query("outcome == 'solved'")
    assert len(solved) >= 7
    for row in solved.itertuples():
        own = made.rounds.query("problem == @row.problem and solver == @row.solver")
        assert set(range(PASSES)) <= set(own["number"])
        assert not own.duplicated(["number", "turn"]).any()
        assert row.total_seconds_min <= row.total_seconds <= row.total_seconds_q3
        assert row.repeats == own["repeats"].sum()


@pytest.mark.slow
def test_the_rounds_of_a_problem_are_spread_over_the_run(made: Run, events: list[Event]) -> None:
    visits = [
        (event.number, event.problem) for event in events if isinstance(event, ProblemStarted) and event.number < PASSES
    ]
    assert [number for number, _ in visits] == sorted(number for number, _ in visits)
    orders = {tuple(problem for number, problem in visits if number == one) for one in range(PASSES)}
    assert len(orders) > 1


@pytest.mark.slow
def test_the_interval_of_a_solver_relative_to_itself_contains_one(made: Run) -> None:
    cases, _ = Store.open(made.folder).read_cases()
    rounds = times_by_point(rounds_frame(cases))[cases[0].solver, cases[0].points[0].tolerance]
    found = ratio(rounds, rounds)
    assert found.value == pytest.approx(1.0)
    assert found.low <= 1.0 <= found.high


def test_case_is_finished_once_a_point_fails() -> None:
    found = case("slow", STEADY, STEADY[:1])
    assert not found.is_finished(PLAN)
    ended = replace(found.points[0], outcome=Outcome.STALLED, status="stalled")
    assert replace(found, points=[ended, found.points[1]]).is_finished(PLAN)


def test_a_time_limit_caused_by_other_programs_is_retried_in_every_pass() -> None:
    plan = replace(PLAN, passes=2)
    waited = [timed_round(number, 9.0, excluded="preempted") for number in range(2)]
    found = [
        replace(
            case("slow", STEADY, STEADY).points[0],
            outcome=Outcome.TIME_LIMIT,
            status="time limit",
            measured=measured_in(waited[:count]),
        )
        for count in (1, 2)
    ]
    rest = Point(tolerance=1e-4, outcome=Outcome.NOT_ATTEMPTED, status="", reason="1e-2 already ended")
    assert [case_record(points=[one, rest]).is_finished(plan) for one in found] == [False, True]


@pytest.mark.parametrize("last", ["solved", "time limit"])
@pytest.mark.parametrize("number", [0, 1])
def test_a_point_that_only_the_last_pass_reaches_needs_no_other_pass(number: int, last: str) -> None:
    """One pass ends at the coarser point by a time limit under load. A point that only pass 0 reaches needs pass 1."""
    plan = replace(PLAN, passes=2)
    coarse, fine = case("slow", STEADY[:2], STEADY[:1]).points
    reached = [timed_round(number, 9.0, excluded="preempted")]
    fine = replace(fine, outcome=Outcome(last), status=last, measured=measured_in(reached))
    assert case_record(points=[coarse, fine]).is_finished(plan) == (number == 1)


@pytest.mark.slow
def test_a_case_that_fails_gets_no_more_rounds_and_stays_failed(tmp_path_factory: pytest.TempPathFactory) -> None:
    made = run(
        "hard-sticking-box",
        ["SORprox", CrashingBelow(1e-3)],
        results=tmp_path_factory.mktemp("r"),
        tolerances=[1e-2, 1e-4],
    )
    failed = made.cases[made.cases["solver"] == "CrashingBelow"].iloc[0]
    assert failed["outcome"] == Outcome.CRASHED
    assert "fine" in failed["reason"]


@pytest.mark.slow
def test_another_source_is_refused_or_mixed_and_marked(tmp_path_factory: pytest.TempPathFactory) -> None:
    made = run("hard-no-motion", ["SORprox", "NSGS"], results=tmp_path_factory.mktemp("r"), tolerances=1e-2, passes=1)
    store = Store.open(made.folder)
    record = store.read_run()
    other = replace(record.machine, source="0" * 64, versions={**record.machine.versions, "numpy": "1.0"})
    store.write_run(replace(record, machine=other, sessions=[replace(record.sessions[0], machine=other)]))
    next((made.folder / "cases").iterdir()).unlink()
    with pytest.raises(BenchError, match=r"numpy 1\.0, now .*source 000000000000, now .*mix=True"):
        resume(made)
    assert load(made).n_finished == 1
    mixed = resume(made, mix=True)
    assert mixed.is_finished
    assert any(warning.startswith("MIXED") and "numpy 1.0" in warning for warning in warnings(mixed))
    assert len({session.machine.source for session in mixed.info.sessions}) == 2


def test_a_pass_or_seed_out_of_range_is_refused(tmp_path_factory: pytest.TempPathFactory) -> None:
    for wrong in ({"passes": 0}, {"seed": -1}):
        with pytest.raises(BenchError, match="must"):
            run("hard-no-motion", "SORprox", results=tmp_path_factory.mktemp("r"), **wrong)
