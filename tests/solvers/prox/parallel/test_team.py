"""A team runs a kernel once in each of its threads, and leaves no thread behind."""

import _thread
import os
import threading
from typing import Any

import pytest
from proxbench.problems import load
from proxbench.solvers import SolverError, Stop, create
from proxbench.solvers.prox.parallel import coloured_sweep
from proxbench.solvers.prox.parallel.team import Team


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_each_thread_runs_the_kernel_with_its_own_number(threads: int) -> None:
    before, meeting = _thread._count(), threading.Barrier(threads)
    numbers = []

    def kernel(number: int, of: int, word: str) -> tuple[int, str]:
        meeting.wait(30.0)  # all threads at the same time
        numbers.append((number, of))
        return number, word

    team = Team()
    for _ in range(3):
        numbers.clear()
        assert team.run(threads, kernel, "word") == (0, "word")
        assert sorted(numbers) == [(number, threads) for number in range(threads)]
    assert _thread._count() == before + threads - 1
    del team
    assert _thread._count() == before


@pytest.mark.parametrize("failing", [0, 2])
def test_a_kernel_that_raises_in_any_thread_raises_each_time_and_leaves_no_thread_running(failing: int) -> None:
    before = _thread._count()

    def fail(number: int, of: int) -> None:
        if number == failing:
            raise ArithmeticError

    team = Team()
    for _ in range(2):
        with pytest.raises(ArithmeticError):
            team.run(3, fail)
    assert team.run(3, lambda number, of: number) == 0
    del team
    assert _thread._count() == before


def test_more_threads_than_cores_are_refused_in_one_sentence() -> None:
    cores = len(os.sched_getaffinity(0))
    allowed = f"a whole number from 1 to {cores}, the cores that this process may use"
    with pytest.raises(SolverError) as raised:
        create("ColouredSORprox", threads=cores + 1)
    assert str(raised.value) == f"ColouredSORprox: threads must be {allowed}, got {cores + 1}."
    for value in (0, 1.0, True, "2"):
        with pytest.raises(SolverError, match="threads must be"):
            create("ColouredSORprox", threads=value)


def test_a_pinned_process_gets_one_thread() -> None:
    """Its machine may have more cores."""
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(allowed)})
    try:
        with pytest.raises(SolverError, match="threads must be 1, because this process may use only one core, got 2"):
            create("ColouredSORprox", threads=2)
    finally:
        os.sched_setaffinity(0, allowed)


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="there is one core alone")
def test_a_solve_leaves_no_thread_running(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(coloured_sweep, "MIN_CONTACTS_PER_THREAD", 1)
    monkeypatch.setattr(coloured_sweep, "MIN_CONTACTS_OF_BALLS_PER_THREAD", 1)
    before, during, run = _thread._count(), [], Team.run

    def counted(team: Team, *arguments: Any) -> Any:
        result = run(team, *arguments)
        during.append(_thread._count())
        return result

    monkeypatch.setattr(Team, "run", counted)
    prepared = create("ColouredSORprox", threads=2).prepare(load("funnel-300"))
    for _ in range(3):
        prepared.solve(Stop(1e-2))
        assert _thread._count() == before
    assert max(during) == before + 1
