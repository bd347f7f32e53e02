"""First solves in fresh processes show what repeated ones hide, and what the processor works shows the clock."""

import contextlib
from collections.abc import Iterator

import numpy as np
import pytest
from habitual_solvers import STOP, Wrapped
from proxbench.bench.isolation.worker import Fault
from proxbench.bench.measure.contacts.case import warm_up_data
from proxbench.bench.measure.contacts.clock_account import ALLOWANCE_SECONDS, REQUEST_SECONDS, SHARE, ClockAccount
from proxbench.bench.measure.contacts.control import Controls
from proxbench.bench.measure.contacts.timed_round import TimedRound
from proxbench.bench.plugins.describing import solver_spec
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import Limits
from proxbench.problems import load
from proxbench.solvers import Status, create

PROBLEM = load("funnel-100")
LIMITS = Limits(solve_seconds=30.0)
MICROSECOND = 1e-6


@pytest.fixture
def controls(request: pytest.FixtureRequest) -> Iterator[Controls]:
    made = Controls(PROBLEM, warm_up_data(PROBLEM), solver_spec(request.param), LIMITS)
    yield made
    made.close()


def test_a_solver_that_remembers_is_accused_with_both_times() -> None:
    problem = load("funnel-1000")  # ten milliseconds, which no noise makes microseconds
    controls = Controls(problem, warm_up_data(problem), solver_spec(Wrapped("remember")), LIMITS)
    with contextlib.closing(controls), pytest.raises(Fault) as found:
        controls.first_solves(STOP, 8 * MICROSECOND, lambda: 8 * MICROSECOND)
    assert found.value.outcome is Outcome.MISBEHAVED
    assert "first solves to 1e-06, in fresh processes, take" in found.value.reason
    assert "repeated ones 8e-06 s" in found.value.reason


@pytest.mark.parametrize("controls", [Wrapped("compile")], indirect=True)
def test_a_solver_that_compiles_on_its_way_is_not_accused(controls: Controls) -> None:
    assert controls.first_solves(STOP, 1e-3, lambda: 1e-2)[-1].timed.status is Status.SOLVED


@pytest.mark.parametrize("controls", [Wrapped()], indirect=True)
def test_the_impulses_of_a_first_solve_are_those_of_the_problem(controls: Controls) -> None:
    expected = create("SORprox").prepare(PROBLEM).solve(STOP)
    for found in controls.first_solves(STOP, 1.0, lambda: 1.0):  # each in a fork that knows nothing of the others
        assert found.impulses.tobytes() == expected.impulses.tobytes()


@pytest.mark.parametrize("controls", [Wrapped()], indirect=True)
def test_a_copy_takes_about_as_long_as_the_problem_and_is_solved_once_then(controls: Controls) -> None:
    assert len(controls.copies(STOP, 1.0)) == 1
    assert len(controls.copies(STOP, 1e-9)) > 1


def of_one_solve(seconds: float) -> TimedRound:
    one = np.array([seconds])
    return TimedRound(Status.SOLVED, 1, "", 0.0 * one, one, one, 0, 0, 0.0)


def test_work_that_the_clock_of_the_process_does_not_count_is_named() -> None:
    account = ClockAccount(PROBLEM)
    assert account.fault(of_one_solve(1.0), worked=1.0 + SHARE + REQUEST_SECONDS) is None
    fault = account.fault(of_one_solve(0.0), worked=ALLOWANCE_SECONDS + 0.1)
    assert fault is not None
    assert "s in rounds, of which its own clock explains 1.0" in fault
