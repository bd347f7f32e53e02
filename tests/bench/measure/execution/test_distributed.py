"""A run on an executor equals a run on one machine: each problem is a task, and lost tasks are repeated or named."""

import multiprocessing
import shutil
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from proxbench.bench import Run, bundle, rejudge, resume, run
from proxbench.bench.errors import BenchError
from proxbench.bench.measure.execution import problem_task
from proxbench.bench.measure.execution.events import CaseFinished, Event, ProblemPassFinished
from proxbench.bench.store.condition import hosts, warnings
from proxbench.bench.store.outcome import Outcome
from proxbench.problems import ContactProblem

PROBLEMS = ["hard-groove", "hard-counterexample", "woodpecker-beak-impact"]
SOLVERS = ["NSGS", "SORprox"]


class Inline(Executor):
    """Executes each task immediately, or a replacement of it."""

    def __init__(self, *instead: Callable[[Any], Any]) -> None:
        self.instead, self.parts = list(instead), list[problem_task.ProblemTask]()

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **options: Any) -> Future[Any]:
        self.parts += arguments
        future: Future[Any] = Future()
        try:
            future.set_result((self.instead.pop(0) if self.instead else function)(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future


def lost(given: Any) -> Any:
    raise ConnectionError("the worker is gone")


def measured(executor: Executor | None, results: Path, **options: Any) -> Run:
    given: dict[str, Any] = {"tolerances": [1e-2], "passes": 1, "results": results, **options}
    return run(given.pop("problems", PROBLEMS), SOLVERS, executor=executor, **given)


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The run on one machine."""
    return measured(None, tmp_path_factory.mktemp("here"), run_id="here")


@pytest.fixture(scope="module")
def processes() -> Iterator[Executor]:
    """Two processes that know only the content of their tasks."""
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as executor:
        yield executor


@pytest.fixture(scope="module")
def threads() -> Iterator[Executor]:
    with ThreadPoolExecutor(2) as executor:
        yield executor


@pytest.mark.slow
@pytest.mark.parametrize("workers", ["threads", pytest.param("processes", marks=pytest.mark.weekly)])
def test_the_judge_reads_the_same_to_the_bit_as_on_one_machine_in_one_session(
    workers: str, here: Run, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    events: list[Event] = []
    made = measured(request.getfixturevalue(workers), tmp_path, on_event=events.append)
    assert made.is_finished
    assert made.points["residual"].equals(here.points["residual"])
    assert made.points["outcome"].tolist() == here.points["outcome"].tolist()
    assert made.info.plan == here.info.plan
    assert [event.done for event in events if isinstance(event, CaseFinished)] == list(range(1, 7))
    assert [event.done for event in events if isinstance(event, ProblemPassFinished)] == [1, 2, 3]
    (session,) = made.info.sessions
    assert len(session.busy_cores) >= len(PROBLEMS)
    assert session.finished
    assert set(made.rounds["session"]) == {0}
    assert rejudge(bundle(made, tmp_path / "it.bundle")).disagreements == []


def elsewhere(host: str) -> Callable[[problem_task.ProblemTask], problem_task.MeasuredProblem]:
    def measure(given: problem_task.ProblemTask) -> problem_task.MeasuredProblem:
        found = problem_task.measure_problem(given)
        machine = found.session.machine
        assert machine is not None
        return problem_task.MeasuredProblem(replace(found.session, machine=replace(machine, host=host)), found.cases)

    return measure


@pytest.fixture(scope="module")
def away(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A run on two other machines."""
    return measured(Inline(*map(elsewhere, ("one", "two", "one"))), tmp_path_factory.mktemp("away"), run_id="it")


@pytest.mark.slow
def test_every_problem_is_of_one_machine_and_rounds_name_its_session(away: Run) -> None:
    assert hosts(away) == {"one": 2, "two": 1}
    assert away.rounds.groupby("problem")["session"].nunique().tolist() == [1, 1, 1]
    assert any(sentence.startswith("MACHINES: measured on 2 machines") for sentence in warnings(away))


@pytest.mark.slow
def test_lost_problems_are_reported_and_the_others_are_kept(here: Run, tmp_path: Path) -> None:
    executor = Inline(lost, elsewhere("it"), lost)
    with pytest.raises(BenchError, match=r"^2 of 3 problems could not be measured \(ConnectionError: the worker"):
        measured(executor, tmp_path, run_id="it")
    again = Inline()
    made = resume(tmp_path / "it", executor=again)
    assert len(again.parts) == 2
    assert made.is_finished
    assert made.points["residual"].equals(here.points["residual"])


class Broken(Inline):
    """Accepts one task, and then no more."""

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **options: Any) -> Future[Any]:
        if self.parts:
            raise RuntimeError("no new tasks after shutdown")
        return super().submit(function, *arguments, **options)


@pytest.mark.weekly
def test_closed_executor_loses_only_the_remaining_problems(tmp_path: Path) -> None:
    with pytest.raises(BenchError, match=r"^2 of 3 problems could not be measured \(RuntimeError: no new tasks"):
        measured(Broken(), tmp_path, run_id="it")
    made = resume(tmp_path / "it")
    assert made.is_finished
    assert len(made.info.sessions) == 2


@pytest.mark.parametrize("failure", [RuntimeError("no new tasks"), OSError("the connection is closed")])
def test_problems_that_an_executor_does_not_take_are_named_as_lost(failure: Exception, tmp_path: Path) -> None:
    class Refusing(Inline):
        def submit(self, function: Callable[..., Any], /, *arguments: Any, **options: Any) -> Future[Any]:
            raise failure

    words = rf"^3 of 3 problems could not be measured \({type(failure).__name__}: {failure}\)"
    with pytest.raises(BenchError, match=words):
        measured(Refusing(), tmp_path)


def test_cancelled_task_counts_as_lost(tmp_path: Path) -> None:
    class Cancelling(Inline):
        def submit(self, function: Callable[..., Any], /, *arguments: Any, **options: Any) -> Future[Any]:
            future: Future[Any] = Future()
            future.cancel()
            future.set_running_or_notify_cancel()
            return future

    with pytest.raises(BenchError, match="3 of 3 problems could not be measured"):
        measured(Cancelling(), tmp_path)


@pytest.mark.slow
def test_a_worker_with_another_source_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def other(given: problem_task.ProblemTask) -> problem_task.MeasuredProblem:
        machine = replace(given.run.machine, source="0" * 64)
        return problem_task.measure_problem(
            problem_task.ProblemTask(replace(given.run, machine=machine), (), given.problems, given.solvers)
        )

    with pytest.raises(
        BenchError, match=r"1 of 1 problems could not be measured \(.*runs a different version of Proxbench"
    ):
        measured(Inline(other), tmp_path, problems=PROBLEMS[:1])


@pytest.mark.slow
def test_a_worker_needs_nothing_but_its_task(processes: Executor, tmp_path: Path) -> None:
    mine = ContactProblem.from_delassus(np.eye(3), (-1.0, 0.5, 0.0), 0.3, name="mine")
    made = measured(processes, tmp_path, problems=[mine])
    assert made.is_finished
    assert made.info.carried == {"mine": mine.digest}


@pytest.mark.slow
def test_threads_of_one_process_measure_one_after_the_other(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    inside: list[int] = []

    class Watched:
        def __init__(self, *_: Any) -> None:
            inside.append(1)
            assert len(inside) == 1

        def execute(self, stored: Any) -> None:
            inside.pop()
            raise ConnectionError

    monkeypatch.setattr(problem_task, "LocalExecutor", Watched)
    with ThreadPoolExecutor(3) as executor, pytest.raises(BenchError, match="ConnectionError"):
        measured(executor, tmp_path)
    assert inside == []


@pytest.fixture
def begun_elsewhere(away: Run, tmp_path: Path) -> Path:
    """A run in which one problem is measured with one of two solvers, on another machine."""
    folder = Path(shutil.copytree(away.folder, tmp_path / "it"))
    next((folder / "cases").glob("hard-groove-*NSGS*.json")).unlink()
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("executor", [pytest.param(None, marks=pytest.mark.weekly), Inline()])
def test_a_problem_begun_on_another_machine_is_measured_anew_as_a_whole(
    executor: Executor | None, begun_elsewhere: Path
) -> None:
    made = resume(begun_elsewhere, executor=executor)
    assert made.is_finished
    assert made.rounds.groupby("problem")["session"].nunique().tolist() == [1, 1, 1]
    assert [count for host, count in hosts(made).items() if host not in ("one", "two")] == [1]


@pytest.mark.slow
def test_crashed_case_discards_measurements_of_another_machine(begun_elsewhere: Path) -> None:
    def crashing(given: problem_task.ProblemTask) -> problem_task.MeasuredProblem:
        found = problem_task.measure_problem(given)
        cases = [replace(case, points=[], outcome=Outcome.CRASHED) for case in found.cases]
        return problem_task.MeasuredProblem(found.session, tuple(cases))

    made = resume(begun_elsewhere, executor=Inline(crashing))
    own = made.cases[made.cases["problem"] == "hard-groove"]
    assert set(own["outcome"]) == {Outcome.CRASHED}


@pytest.mark.weekly
def test_a_problem_begun_on_another_machine_is_finished_here_if_machines_may_mix(begun_elsewhere: Path) -> None:
    made = resume(begun_elsewhere, executor=Inline(), mix=True)
    assert made.rounds[made.rounds["problem"] == "hard-groove"]["session"].nunique() == 2
    assert any(sentence.startswith("MIXED") for sentence in warnings(made))
