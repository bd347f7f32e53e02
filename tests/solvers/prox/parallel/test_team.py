"""A team runs a kernel in each of its threads, and leaves no thread behind."""

import _thread
import os
import subprocess
import sys
import time
from typing import Any

import numpy as np
import pytest
from numba import njit
from proxbench.problems import load
from proxbench.solvers import SolverError, Stop, create
from proxbench.solvers.prox.parallel import coloured_sweep, slabs
from proxbench.solvers.prox.parallel.atomic import add, read, yield_core
from proxbench.solvers.prox.parallel.team import AWAY, Team, _Member, joins_call, leave_call

MAX_YIELDS = 10_000
"""Number of times that thread 0 yields its core while it waits for the others, milliseconds on an idle machine."""


@njit(nogil=True)
def _count_parts(number, threads, calls, states, parts, starts):  # type: ignore[no-untyped-def]
    """Count the parts of each thread, and how often it is started; thread 0 waits for the others, but not forever."""
    add(starts, number, 1)
    if number == 0:
        add(parts, 0, 1)
        yields, other = 0, 1
        while other < threads and yields < MAX_YIELDS:
            if read(parts, other) > 0:
                other += 1
            yield_core()
            yields += 1
        return 0
    while joins_call(calls, states, number):
        add(parts, number, 1)
        leave_call(states, number)
    return 0


@njit(nogil=True)
def _count_alone(number, threads, calls, states, parts):  # type: ignore[no-untyped-def]
    """Count the calls in which a thread takes part, without waiting for others."""
    if number == 0:
        return add(parts, 0, 1)
    while joins_call(calls, states, number):
        add(parts, number, 1)
        leave_call(states, number)
    return 0


def all_take_part(team: Team, parts: np.ndarray) -> bool:
    """Return whether all threads took part in one of a hundred calls; a late one may miss a call, but none does two."""
    for _ in range(100):
        parts[:] = 0
        team.run()
        assert parts[0] == 1
        assert parts.max() == 1
        if parts.min() == 1:
            return True
    return False


def becomes_idle(member: _Member) -> bool:
    """Wait until a member is idle, and return whether it is after 30 s."""
    deadline = time.monotonic() + 30.0
    while not member.is_idle and time.monotonic() < deadline:
        time.sleep(1e-3)
    return member.is_idle


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_each_thread_takes_part_in_calls(threads: int) -> None:
    before = _thread._count()
    parts, starts = np.zeros((2, threads), dtype=np.int64)
    _count_parts(0, 1, parts[:1], parts[:1], parts.copy(), starts.copy())  # compiled here
    team = Team(threads, _count_parts, parts, starts)
    for _ in range(3):
        assert all_take_part(team, parts)
    assert starts.max() <= starts[0]  # at most once for each call
    assert _thread._count() == before + threads - 1
    del team
    assert _thread._count() == before


def test_a_thread_that_stopped_waiting_takes_part_in_later_calls() -> None:
    parts, starts = np.zeros((2, 2), dtype=np.int64)
    team = Team(2, _count_parts, parts, starts)
    assert all_take_part(team, parts)
    started = starts[1]
    assert becomes_idle(team._members[0])  # after a millisecond
    assert all_take_part(team, parts)
    assert starts[1] > started


def test_threads_that_were_started_before_take_part_in_the_next_call() -> None:
    parts, starts = np.zeros((2, 3), dtype=np.int64)
    team = Team(3, _count_parts, parts, starts)
    team.start()
    assert len(team._members) == 2
    assert all_take_part(team, parts)
    assert len(team._members) == 2


def test_a_call_does_not_wait_for_a_thread_that_has_not_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    """Such a thread is marked as away, so that it cannot begin its part after the call."""
    parts = np.zeros(2, dtype=np.int64)
    begun: list[Any] = []
    with monkeypatch.context() as patch:
        patch.setattr(_Member, "begin", lambda self, function: begun.append((self, function)))
        team = Team(2, _count_alone, parts)
        team.run()
        assert team._states[1] == AWAY
    for member, function in begun:
        member.begin(function)
    team.run()
    del team
    assert parts[0] == 2
    assert parts[1] <= 1


@pytest.mark.parametrize("failing", [0, 2])
def test_a_kernel_that_raises_in_any_thread_raises_each_time_and_leaves_no_thread_running(failing: int) -> None:
    before = _thread._count()
    fails = [True]

    def kernel(number: int, threads: int, calls: Any, states: Any) -> None:
        if fails[0] and number == failing:
            raise ArithmeticError
        if number == 0:
            deadline = time.monotonic() + 30.0
            while (states[1:] != AWAY).any() and time.monotonic() < deadline:  # the others end before the call returns
                time.sleep(1e-3)

    team = Team(3, kernel)
    for _ in range(2):
        with pytest.raises(ArithmeticError):
            team.run()
        for member in team._members:
            assert becomes_idle(member)
    fails[0] = False
    team.run()
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
    monkeypatch.setattr(coloured_sweep, "MIN_EFFICIENCY", 0.0)
    monkeypatch.setattr(slabs, "MIN_SLAB", 8)
    before, during, run = _thread._count(), [], Team.run

    def counted(team: Team, *arguments: Any) -> Any:
        result = run(team, *arguments)
        during.append(_thread._count())
        return result

    monkeypatch.setattr(Team, "run", counted)
    prepared = create("ColouredSORprox", threads=2).prepare(load("funnel-300"))
    for _ in range(3):
        prepared.solve(Stop(1e-8))
        assert _thread._count() == before
    assert max(during) == before + 1


@pytest.mark.slow
def test_threads_that_wait_at_the_end_of_a_process_do_not_delay_it() -> None:
    """They wait for the lock of the interpreter, which the process never releases."""
    program = """
import numpy as np
from proxbench.problems import load
from proxbench.solvers.prox.parallel import coloured_sweep, slabs
from proxbench.solvers.sweeps.step_size import diagonal_step_sizes
coloured_sweep.MIN_CONTACTS_PER_THREAD, coloured_sweep.MIN_EFFICIENCY, slabs.MIN_SLAB = 1, 0.0, 8
problem = load("funnel-300")
sweep = coloured_sweep.ColouredSweep.over(problem, diagonal_step_sizes(problem, 1.0), 2)
assert sweep.threads == 2
iterates = coloured_sweep.ColouredIterates(sweep, np.zeros(problem.n_rows), 0.0)
iterates.sweep(1)
release = iterates.sweep  # lives until modules are cleared
"""
    ended = subprocess.run([sys.executable, "-c", program], timeout=120, capture_output=True, text=True)
    assert ended.returncode == 0
    assert "Exception" not in ended.stderr
