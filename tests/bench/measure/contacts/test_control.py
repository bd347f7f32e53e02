"""A first solve in a fresh process shows what repeated ones hide, and what the processor works shows the clock."""

import contextlib
from collections.abc import Iterator

import pytest
from habitual_solvers import STOP, Wrapped
from proxbench.bench.isolation.worker import Fault
from proxbench.bench.measure.contacts.clock_account import ALLOWANCE, FACTOR, ClockAccount
from proxbench.bench.measure.contacts.control import Controls, explains
from proxbench.bench.measure.contacts.variants import another_data
from proxbench.bench.plugins.describing import contestant
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.records import Limits
from proxbench.problems import load
from proxbench.solvers import Status, create

PROBLEM = load("funnel-100")
LIMITS = Limits(solve_seconds=30.0)
MICROSECOND = 1e-6


@pytest.fixture
def controls(request: pytest.FixtureRequest) -> Iterator[Controls]:
    made = Controls(PROBLEM, another_data(PROBLEM), contestant(request.param), LIMITS)
    yield made
    made.close()


def test_a_solver_that_remembers_is_accused_with_both_times() -> None:
    problem = load("funnel-1000")  # ten milliseconds, which no noise makes microseconds
    controls = Controls(problem, another_data(problem), contestant(Wrapped("remember")), LIMITS)
    with contextlib.closing(controls), pytest.raises(Fault) as found:
        controls.first_solve(STOP, 8 * MICROSECOND, lambda: 8 * MICROSECOND)
    assert found.value.outcome is Outcome.MISBEHAVED
    assert "a first solve to 1e-06, in a fresh process, took at least" in found.value.reason
    assert "repeated ones 8e-06 s" in found.value.reason


@pytest.mark.parametrize("controls", [Wrapped("compile")], indirect=True)
def test_a_solver_that_compiles_on_its_way_is_not_accused(controls: Controls) -> None:
    assert controls.first_solve(STOP, 1e-3, lambda: 1e-2).status is Status.SOLVED


@pytest.mark.parametrize("controls", [Wrapped()], indirect=True)
def test_the_impulses_of_a_first_solve_are_those_of_the_problem(controls: Controls) -> None:
    expected = create("SORprox").prepare(PROBLEM).solve(STOP)
    for _ in range(2):  # each in a copy that knows nothing of the other
        found = controls.first_solve(STOP, 1.0, lambda: 1.0)
        assert found.impulses.tobytes() == expected.impulses.tobytes()


def test_times_are_explained_up_to_caches_and_clock_speed() -> None:
    assert explains(1e-3, 2e-3)
    assert explains(0.0, 1e-4)
    assert not explains(57 * MICROSECOND, 845 * MICROSECOND)
    assert not explains(1e-2, 1e-1)


def test_work_that_the_clock_of_the_process_does_not_count_is_named() -> None:
    account = ClockAccount(PROBLEM)
    assert account.fault([(0.5, 0.5)], passed=1.1, worked=1.1) is None
    assert account.fault([(0.5, 0.5)], passed=1.1, worked=4.4) is None  # four threads
    assert account.fault([(0.5, 0.5)], passed=9.0, worked=1.1) is None  # a busy machine
    fault = account.fault([(0.0, 0.0)], passed=9.0, worked=FACTOR * 3.0 + ALLOWANCE + 1.0)
    assert fault is not None
    assert "s in rounds, of which its own clock explains 3" in fault
